"""The reference line in the world, and what drivers see of it."""

import sys
from dataclasses import replace

import numpy as np
import pytest

from race_server.competition.race_day.formats import Obstacles
from race_server.competition.race_day.obstacles import with_obstacles
from race_server.core.observation import Observation, layout_of, wants_line
from race_server.core.vehicle_presets import TT02
from race_server.envs.batch import Batch
from race_server.envs.presets import task_on
from race_server.scenario.race import Scenario, make_worlds
from race_server.scenario.raceline.attach import reference_line, with_line
from race_server.scenario.raceline.detour import edge_of
from race_server.scenario.track.course import Obstacle
from race_server.scenario.track.line import ReferenceLine
from race_server.scenario.track.load import load_course
from race_server.scenario.track.polyline import nearest_on
from race_server.session.session import Session
from support.courses import SMALL_RING

RING = replace(SMALL_RING, digest="a ring of 6 m")


def seen(scenario: Scenario, x: float, y: float, heading: float) -> Observation:
    """Return what the only kart of a scenario sees from a place on the course."""
    session = Session("t", scenario)
    session.join("someone", "line")
    session.seats[0].is_ready = True
    session.start()
    body, racer = session.world.bodies[0, 0], session.world.racers[0, 0]
    body.x, body.y, body.heading = x, y, heading
    line = scenario.course.line
    racer.line_index = int(np.argmin(np.hypot(line[:, 0] - x, line[:, 1] - y)))
    session.observe()
    return Observation(0, session.layout("line"), session.view(0).copy())


def on_the_ring(radius: float, turned: float = 0.0) -> Observation:
    """Return what a kart sees at the east end of a ring of 6 m, whose centre line is the line."""
    scenario = with_line(Scenario(RING, karts=1))
    return seen(scenario, radius, 0.0, 0.5 * np.pi + turned)


def test_a_kart_on_the_line_has_no_offset_and_no_heading_error() -> None:
    view = on_the_ring(6.0)
    assert view.scalar("line_offset") == pytest.approx(0.0, abs=1e-6)
    assert view.scalar("line_heading") == pytest.approx(0.0, abs=1e-6)
    assert (view["line_ahead_x"][0], view["line_ahead_y"][0]) == pytest.approx((0.0, 0.0), abs=1e-6)


def test_offset_and_heading_are_positive_to_the_left() -> None:
    # The ring is driven counter-clockwise: its middle is on the left.
    view = on_the_ring(5.7, turned=0.1)
    assert view.scalar("line_offset") == pytest.approx(0.3, abs=1e-5)
    assert view.scalar("line_heading") == pytest.approx(0.1, abs=1e-5)
    assert view["line_ahead_y"][0] == pytest.approx(-0.3 * np.cos(0.1), abs=1e-5)


def test_the_line_ahead_begins_at_the_kart_and_goes_on_in_equal_steps() -> None:
    view = on_the_ring(6.0)
    step = view.scalar("line_step")
    assert step == pytest.approx(0.5 * TT02.length)
    angles = np.arange(16) * step / 6.0
    assert view["line_ahead_x"] == pytest.approx(6.0 * np.sin(angles), abs=1e-3)
    assert view["line_ahead_y"] == pytest.approx(6.0 - 6.0 * np.cos(angles), abs=1e-3)
    assert view["line_curvature_ahead"] == pytest.approx(1.0 / 6.0)
    # A bend of 6 m with 5 m/s² of grip: at 97.6 % of it the motor just makes up for the slip.
    assert view["line_speed_ahead"] == pytest.approx(np.sqrt(0.976 * 30.0), rel=2e-3)
    assert view["line_left_ahead"] == pytest.approx(0.7)


def line_with(speeds: list[float]) -> ReferenceLine:
    """Return a line of which only the speeds count."""
    rest = np.zeros(len(speeds))
    beside = np.arange(len(speeds))
    return ReferenceLine(1.0, rest, rest, rest, rest, np.array(speeds), rest, rest, beside)


def test_the_speed_held_leaves_a_fifth_of_the_braking() -> None:
    # From 10 m/s to 6 m/s the squares lose 64; 4/5 of that above 36 are 87.2, and a step before
    # the brakes have as much again.
    held = line_with([10.0, 10.0, 6.0, 6.0]).held
    assert held**2 == pytest.approx([100.0, 87.2, 36.0, 36.0])


def test_the_speed_held_looks_around_the_end_of_the_lap() -> None:
    held = line_with([6.0, 8.0, 10.0, 10.0]).held
    assert held**2 == pytest.approx([36.0, 64.0, 100.0, 87.2])


def test_where_the_line_never_brakes_its_own_speed_is_held() -> None:
    assert line_with([5.0] * 4).held == pytest.approx(5.0)
    view = on_the_ring(6.0)
    assert view.scalar("line_speed_held") == pytest.approx(view["line_speed_ahead"][-1], rel=1e-4)


def test_rivals_are_told_of_along_the_line_and_across_it() -> None:
    session = Session("t", with_line(Scenario(RING, karts=3)))
    for number in range(3):
        session.join("someone", "rivals")
        session.seats[number].is_ready = True
    session.start()
    bodies, racers = session.world.bodies[0], session.world.racers[0]
    for kart, angle, radius in ((0, 0.0, 6.0), (1, 0.2, 5.8), (2, -0.4, 6.1)):
        bodies[kart].x, bodies[kart].y = radius * np.cos(angle), radius * np.sin(angle)
        racers[kart].line_index = round(angle / (2.0 * np.pi) * len(RING.line)) % len(RING.line)
    session.observe()
    view = Observation(0, session.layout("rivals"), session.view(0))
    assert view["karts_along"] == pytest.approx([1.2, -2.4, 1000.0, 1000.0], abs=0.02)
    assert view["karts_across"] == pytest.approx([0.2, -0.1, 0.0, 0.0], abs=0.01)


def test_the_fastest_line_of_the_oval_cuts_its_bends() -> None:
    scenario = with_line(Scenario(load_course("oval"), karts=1))
    assert scenario.line is not None
    assert scenario.line.note == ""
    # At the east end of the oval the centre line is 4.5 m from the middle, the inner border 3.9 m.
    view = seen(scenario, 4.5, 0.0, 0.5 * np.pi)
    assert -0.46 < view.scalar("line_offset") < -0.2
    assert view["line_left_ahead"][0] == pytest.approx(0.6 + view.scalar("line_offset"), abs=0.02)
    everywhere = np.stack([scenario.line.x, scenario.line.y], axis=1)
    steps = np.hypot(*(np.roll(everywhere, -1, axis=0) - everywhere).T)
    assert steps == pytest.approx(scenario.line.spacing, rel=0.02)


@pytest.mark.parametrize("place", [0, 100, 214, 427])
def test_a_kart_anywhere_on_the_fastest_line_is_on_it(place: int) -> None:
    scenario = with_line(Scenario(load_course("oval"), karts=1))
    line = scenario.line
    assert line is not None
    view = seen(scenario, line.x[place], line.y[place], line.heading[place])
    assert view.scalar("line_offset") == pytest.approx(0.0, abs=1e-6)
    assert view.scalar("line_heading") == pytest.approx(0.0, abs=1e-6)
    assert view["line_speed_ahead"][0] == pytest.approx(line.speed[place], rel=1e-6)
    assert view["line_curvature_ahead"][0] == pytest.approx(line.curvature[place], abs=1e-6)


def test_without_a_line_its_parts_are_zero() -> None:
    view = seen(Scenario(RING, karts=1), 6.0, 0.0, 0.5 * np.pi)
    for name in view.layout.slices:
        if name.startswith("line_"):
            assert not view[name].any(), name


def test_a_batch_may_mix_lines_on_one_course() -> None:
    plain = Scenario(load_course("oval"), karts=1)
    lined = with_line(plain)
    world = make_worlds([plain, lined, lined], [0, 0, 0])
    assert len(world.route.courses) == 2
    assert (world.route.courses["reference_spacing"][world.rules["course"]] > 0).tolist() == [
        False,
        True,
        True,
    ]


def test_where_no_limit_is_known_the_centre_line_stands_in_and_says_so() -> None:
    line = reference_line(RING, TT02)
    assert "no reference limit is known for tt02, so the centre line stands in" in line.note
    assert np.allclose(np.hypot(line.x, line.y), 6.0)


def test_without_casadi_the_line_that_stands_in_names_the_way_out(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)
    scenario = with_line(with_line(Scenario(RING, karts=1)), solve=True)
    assert scenario.line is not None
    assert "pip install race-server[mpc]`; the centre line stands in" in scenario.line.note


def test_the_line_leads_around_an_obstacle_and_is_itself_again_behind_it() -> None:
    # A car turned along the ring at its north end, its middle 0.2 m outside of the line.
    box = Obstacle(0.0, 6.2, np.pi, TT02.length, TT02.width)
    plain, led = (reference_line(replace(RING, obstacles=boxes), TT02) for boxes in ((), (box,)))
    beside = np.argmax(led.y)
    # Half its width, half the car's own and half a width of room are inside of 6.2 m.
    assert np.hypot(led.x, led.y)[beside] == pytest.approx(6.2 - 1.5 * TT02.width, abs=0.03)
    assert led.right[beside] == pytest.approx(TT02.width, abs=0.04)
    assert led.speed.min() < 0.98 * plain.speed.min()
    assert np.hypot(led.x[0], led.y[0]) == pytest.approx(6.0, abs=1e-3)
    assert led.speed[0] == pytest.approx(plain.speed[0], rel=5e-3)


@pytest.mark.parametrize("seed", [1, 4])
def test_no_part_of_a_car_on_the_line_comes_near_an_obstacle_or_a_border(seed: int) -> None:
    course = with_obstacles(load_course("covapsy-train-2023"), Obstacles(), TT02, seed)
    line = reference_line(course, TT02)
    assert line.note == ""  # the limit of the empty course is known
    boxes = np.vstack([edge_of(box) for box in course.obstacles])
    for x, y, heading in zip(line.x[::8], line.y[::8], line.heading[::8], strict=True):
        car = edge_of(Obstacle(x, y, heading, TT02.length, TT02.width))
        apart = np.hypot(*(car[:, None] - boxes).transpose(2, 0, 1))
        assert apart.min() > 0.07
        assert nearest_on(course.borders, car)[0].min() > 0.02


def test_a_batch_attaches_the_line_that_a_scripted_driver_wants() -> None:
    scenario = Scenario(load_course("oval"), karts=2)
    batch = Batch(task_on((scenario,), opponents=("raceline",)))
    assert batch.world.route.courses["reference_spacing"][0] > 0.0
    assert Batch(task_on((scenario,))).world.route.courses["reference_spacing"][0] == 0.0


def test_the_presets_line_and_full_tell_of_the_line() -> None:
    told = {name: wants_line(name) for name in ("lidar", "radar", "track", "line", "full")}
    assert told == {"lidar": False, "radar": False, "track": False, "line": True, "full": True}
    assert layout_of("line", 41).size == layout_of("line", 201).size


def test_beside_the_tip_of_a_wall_the_room_is_the_way_to_the_tip() -> None:
    course = load_course("covapsy-train-2023")
    line = reference_line(course, TT02)
    there = np.column_stack([line.x, line.y])
    way, _ = nearest_on(course.borders, there)
    # Half a station further on the tip may be nearer, by 3 mm at most.
    assert np.minimum(line.left, line.right) == pytest.approx(way, abs=3e-3)
