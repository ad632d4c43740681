"""The drivers that follow the reference line: alone, behind a slower kart, and past it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from race_agents.planning.clearance import keep_clear
from race_agents.planning.idm_model import follow_acceleration
from race_agents.planning.latency import (
    LATENCY,
    estimate_latency,
    remember_command,
    steering_play,
    take_up_play,
)
from race_agents.planning.tracking import speed_on_line, steering_on_line
from race_agents.planning.traffic import NOWHERE
from race_agents.planning.tyre_slip import rear_effort, tyre_slip
from race_server.competition.race_day.formats import Obstacles
from race_server.competition.race_day.obstacles import with_obstacles
from race_server.competition.time_trial.gaps import GAPS, Gap
from race_server.competition.time_trial.run import drive_run
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.kernel_driver import ATTEMPTS, Cockpit, cockpit_for, memory_size
from race_server.core.messages import Status
from race_server.core.observation import PART_NUMBERS, layout_of, offsets_of
from race_server.core.vehicle_presets import KART_60, TT02
from race_server.core.vehicles import GRAVITY, vehicle_record
from race_server.envs.reality_gap import RealityGap
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.raceline.attach import with_line
from race_server.scenario.raceline.reference import reference_limit
from race_server.scenario.track.load import load_course
from race_server.session.session import Session
from support.briefings import briefing
from support.courses import SMALL_RING, ring
from support.races import run_race

SLOW = replace(TT02, name="slow", top_speed=1.5)


def chase(name: str, half_width: float) -> Session:
    """Return the session after two laps of a driver that starts behind a kart of 1.5 m/s."""
    course = replace(ring(radius=6.0, half_width=half_width), digest=f"ring {half_width}")
    rules = Rules(laps=2, items=False, countdown_s=0.5, limit_s=120.0)
    scenario = Scenario(course, karts=2, vehicles=(TT02, SLOW), rules=rules, grid_order=(1, 0))
    session, _ = run_race(with_line(scenario), [name, "pure_pursuit"])
    return session


@pytest.mark.parametrize("name", ["raceline", "idm"])
def test_a_driver_on_the_line_laps_the_oval_nearly_as_fast_as_can_be(name: str) -> None:
    rules = Rules(laps=3, items=False, countdown_s=0.5)
    scenario = with_line(Scenario(load_course("oval"), karts=1, rules=rules))
    session, _ = run_race(scenario, [name])
    limit = reference_limit(scenario.course, TT02).minimum_time.time_s
    racer = session.world.racers[0, 0]
    assert racer.wall_contacts == 0
    assert 0.98 * limit < racer.best_lap_us / 1e6 < 1.05 * limit


def test_a_kart_on_the_grid_joins_a_line_3_metres_aside_without_a_touch() -> None:
    rules = Rules(laps=1, items=False, countdown_s=0.5)
    course = load_course("hangar-400")
    session, _ = run_race(
        with_line(Scenario(course, karts=1, vehicles=(KART_60,), rules=rules)), ["raceline"]
    )
    racer = session.world.racers[0, 0]
    assert racer.wall_contacts == 0
    assert racer.best_lap_us < 40e6  # from standing; the limit of a flying lap is 31.0 s


@pytest.mark.parametrize("name", ["raceline", "idm"])
def test_a_slower_kart_is_passed_where_there_is_room(name: str) -> None:
    session = chase(name, half_width=1.0)
    (chaser_body, _), (chaser_racer, slow_racer) = (
        session.world.bodies[0],
        session.world.racers[0],
    )
    assert chaser_body.status == Status.FINISHED
    assert chaser_racer.rank == 1
    assert (chaser_racer.contacts, slow_racer.contacts) == (0, 0)
    assert chaser_racer.wall_contacts == 0


@pytest.mark.parametrize("name", ["raceline", "idm"])
def test_a_slower_kart_is_followed_where_there_is_none(name: str) -> None:
    session = chase(name, half_width=0.3)
    chaser, slow = session.world.racers[0]
    assert slow.rank == 1
    assert (chaser.contacts, slow.contacts) == (0, 0)
    assert chaser.wall_contacts == 0


@pytest.mark.parametrize("name", ["raceline", "idm"])
def test_what_stands_on_the_track_is_passed_without_a_touch(name: str) -> None:
    course = with_obstacles(load_course("covapsy-train-2023"), Obstacles(), TT02, seed=4)
    rules = Rules(laps=1, items=False, countdown_s=0.5, limit_s=60.0)
    session, _ = run_race(with_line(Scenario(course, karts=1, rules=rules)), [name])
    body, racer = session.world.bodies[0, 0], session.world.racers[0, 0]
    assert body.status == Status.FINISHED
    assert racer.wall_contacts == 0


@pytest.mark.parametrize("delay", [1, 2])
def test_answers_that_act_late_cost_no_time(delay: int) -> None:
    late = Gap("late", RealityGap(action_delay=(delay, delay)))
    cell = RunSpec("raceline", "covapsy-test-2023", gap=late, laps=1)
    (lap,) = drive_run(cell).laps
    limit = reference_limit(load_course(cell.track), TT02).minimum_time.time_s
    assert lap.is_clean
    assert lap.time_s < 1.06 * limit


def test_a_car_on_tyres_that_hardly_slip_touches_nothing_either() -> None:
    cell = RunSpec("raceline", "covapsy-test-2023", vehicle="tt02-facts", laps=1)
    (lap,) = drive_run(cell).laps
    assert lap.is_clean


@pytest.mark.parametrize("delay", [0, 2, 3, 7])
def test_how_the_wheels_turn_tells_how_late_commands_act(delay: int) -> None:
    # Thirds of a decision; the wheels are asked for another angle at every third one.
    at, seen, control = np.zeros(len(PART_NUMBERS), np.int64), np.zeros(1), np.zeros(4)
    memory, setup = np.zeros(memory_size(0)), np.array([0.0, 0.0, 0.05])
    vehicle = vehicle_record(TT02)[0]
    cockpit = Cockpit(seen, at, vehicle, setup, np.zeros(1, np.int64), memory, control)
    turn = TT02.steering_rate * 0.05 / 3.0
    asked = [0.0]
    for step in range(3 * 30):
        if step % 3 == 0:
            estimate_latency(cockpit)
            control[0] = 0.8 * math.sin(1.7 * (step // 9))
            remember_command(memory, control)
        asked.append(control[0] * TT02.steering_limit)
        wanted = asked[max(len(asked) - 1 - delay, 0)]
        seen[0] += min(max(wanted - seen[0], -turn), turn)
    assert memory[LATENCY] == delay


def preview(held: float) -> Cockpit:
    """Return a cockpit on a straight whose line has 10 m/s, with the speed held behind it."""
    layout = layout_of("line", 0)
    offsets, seen = offsets_of(layout), np.zeros(layout.size)
    for name, value in (("line_speed_ahead", 10.0), ("line_step", 0.2), ("grip_scale", 1.0)):
        seen[layout.slices[name]] = value
    seen[layout.slices["speed_cap"]], seen[layout.slices["line_speed_held"]] = 99.0, held
    setup, uses = np.array([0.0, 0.0, 0.05]), np.zeros(1, np.int64)
    return Cockpit(seen, offsets, vehicle_record(TT02)[0], setup, uses, np.zeros(0), np.zeros(4))


def test_a_bend_beyond_the_preview_is_braked_for() -> None:
    # The line keeps its 10 m/s for all the 3 m that are seen: what is behind them decides.
    assert speed_on_line(preview(held=10.0), 0.0, 0.0, 0.0) == pytest.approx(9.9)
    # On them the brakes have 55 % of the grip.
    wanted = math.sqrt(4.95**2 + 2.0 * 0.55 * TT02.grip * GRAVITY * 3.0)
    assert speed_on_line(preview(held=5.0), 0.0, 0.0, 0.0) == pytest.approx(wanted)
    assert speed_on_line(preview(held=5.0), 0.0, 3.0, 0.0) == pytest.approx(4.95, rel=1e-3)


def test_an_observation_without_the_speed_held_is_driven_by_its_preview() -> None:
    cockpit = preview(held=5.0)
    cockpit.offsets[PART_NUMBERS["line_speed_held"]] = -1
    assert speed_on_line(cockpit, 0.0, 0.0, 0.0) == pytest.approx(9.9)


def test_without_a_line_nobody_drives_by_one() -> None:
    rules = Rules(laps=1, items=False, countdown_s=0.5, limit_s=3.0)
    session, _ = run_race(Scenario(SMALL_RING, karts=1, rules=rules), ["raceline"])
    assert session.world.racers[0, 0].distance < 1.0


def test_a_rear_axle_that_slips_half_as_far_as_it_slides_uses_seven_eighths_of_its_grip() -> None:
    cockpit = preview(held=4.0)
    slide = 3.0 * TT02.grip / TT02.cornering
    for share, used in ((0.0, 0.0), (0.5, 0.875), (1.0, 1.0), (-2.0, 1.0)):
        across = 4.0 * math.tan(share * slide)
        cockpit.observation[layout_of("line", 0).slices["lateral_speed"]] = across
        assert rear_effort(cockpit, 4.0) == pytest.approx(used, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["generated:block:3000055", "generated:circuit:3000087"])
def test_a_kart_whose_rear_slides_lifts_and_touches_nothing(name: str) -> None:
    # Both lines go from full grip on one side to full grip on the other.
    scenario = Scenario(load_course(name), karts=1, rules=Rules(laps=2, items=False))
    session, _ = run_race(with_line(scenario, solve=True), ["raceline"])
    racer = session.world.racers[0, 0]
    assert (int(racer.laps), int(racer.wall_contacts)) == (2, 0)


def test_far_behind_another_kart_only_the_own_speed_counts() -> None:
    # a (1 - (v / v0)⁴) with a = 2 and v = v0 / 2.
    free = follow_acceleration(4.0, 8.0, 1e9, 0.0, 2.0, 3.0, 0.2)
    assert free == pytest.approx(2.0 * (1.0 - 1.0 / 16.0))


def test_at_the_wanted_gap_and_at_equal_speed_nothing_is_left_to_accelerate() -> None:
    # s* = 0.2 + 4 · 0.35 = 1.6 m, so that the last term is one.
    held = follow_acceleration(4.0, 8.0, 1.6, 0.0, 2.0, 3.0, 0.2)
    assert held == pytest.approx(-2.0 / 16.0)
    # Closing in at 1 m/s it wants 4 · 1 / (2 √6) m more.
    closing = follow_acceleration(4.0, 8.0, 1.6 + 2.0 / math.sqrt(6.0), 1.0, 2.0, 3.0, 0.2)
    assert closing == pytest.approx(held)


def test_the_slip_that_is_steered_for_gives_the_force_that_is_wanted() -> None:
    from race_server.core.kernels.motion import tyre_stiffness

    limit = 0.5 * TT02.mass * GRAVITY * TT02.grip
    stiffness = 0.5 * TT02.mass * GRAVITY * TT02.cornering
    for used in (0.1, 0.5, 0.9):
        slip = tyre_slip(used, 3.0 * limit / stiffness)
        assert slip * tyre_stiffness(slip, stiffness, limit) == pytest.approx(used * limit)


def beside_walls(speed: float, left: float, right: float, bend: float = 0.0) -> Cockpit:
    """Return a cockpit on an even line at its speed, with so much asphalt to its left and right."""
    cockpit = preview(held=speed)
    seen, slices = cockpit.observation, layout_of("line", 0).slices
    for name, value in (
        *(("speed", speed), ("line_speed_ahead", speed), ("line_curvature_ahead", bend)),
        *(("line_left_ahead", left), ("line_right_ahead", right)),
    ):
        seen[slices[name]] = value
    return cockpit._replace(memory=np.zeros(memory_size(0)))


def test_a_body_needs_a_sixth_of_its_width_beside_it_and_5_mm_for_each_metre_per_second() -> None:
    # 0.095 m of half-width, 0.0304 m, and 0.1 rad for 0.05 s at 4 m/s.
    needed = 0.095 + 0.16 * 0.19 + 0.02
    assert keep_clear(beside_walls(4.0, 1.0, needed), 0.0) == pytest.approx(0.0, abs=1e-9)
    assert keep_clear(beside_walls(4.0, 1.0, needed - 0.03), 0.0) == pytest.approx(0.03)
    assert keep_clear(beside_walls(4.0, needed - 0.03, 1.0), 0.0) == pytest.approx(-0.03)
    # In a lane 2 cm to the left of the line it has 2 cm more on its right.
    assert keep_clear(beside_walls(4.0, 1.0, needed - 0.03), 0.02) == pytest.approx(0.01)


def test_between_two_walls_it_keeps_to_the_middle() -> None:
    assert keep_clear(beside_walls(4.0, 0.12, 0.12), 0.0) == pytest.approx(0.0, abs=1e-9)
    assert keep_clear(beside_walls(4.0, 0.12, 0.10), 0.0) == pytest.approx(0.01)


def test_the_nose_points_into_a_bend_and_needs_room_there() -> None:
    # All grip at 4 m/s: 5 m/s² on a radius of 3.2 m. 0.145 m is enough along a straight at 4 m/s.
    bend = 0.95 * TT02.grip * GRAVITY / 16.0
    wall_inside = beside_walls(4.0, 0.146, 1.0, bend)
    slip = tyre_slip(0.95, 3.0 * TT02.grip / TT02.cornering)
    nose = 0.5 * TT02.length * (slip - TT02.rear_axle * bend)
    assert nose == pytest.approx(0.018, abs=0.002)
    assert keep_clear(wall_inside, 0.0) == pytest.approx(-nose, abs=0.002)


def test_wheels_with_play_are_turned_to_where_they_should_be() -> None:
    # 1 degree of play: wheels stop half of it before what is commanded.
    at, seen, control = np.zeros(len(PART_NUMBERS), np.int64), np.zeros(1), np.zeros(4)
    memory, setup = np.zeros(memory_size(0)), np.array([0.0, 0.0, 0.05])
    vehicle, half = vehicle_record(TT02)[0], math.radians(0.5)
    cockpit = Cockpit(seen, at, vehicle, setup, np.zeros(1, np.int64), memory, control)
    for step in range(120):
        estimate_latency(cockpit)
        control[0] = 0.3 * math.sin(0.3 * step)
        remember_command(memory, control)
        asked = control[0] * TT02.steering_limit
        seen[0] = min(max(seen[0], asked - half), asked + half)
    assert memory[LATENCY] == 0
    assert steering_play(memory) == pytest.approx(half, rel=0.1)
    commanded = take_up_play(memory, 0.1, now=0.0)
    assert min(max(0.0, commanded - half), commanded + half) == pytest.approx(0.1, abs=0.001)


@pytest.mark.parametrize(
    ("driver", "gap"),
    [("raceline", "play"), ("raceline", "all"), ("learned:full", "delay"), ("learned:full", "all")],
)
def test_a_loose_and_late_steering_touches_nothing(driver: str, gap: str) -> None:
    cell = RunSpec(driver, "covapsy-test-2023", gap=GAPS[gap], laps=1)
    (lap,) = drive_run(cell).laps
    limit = reference_limit(load_course(cell.track), TT02).minimum_time.time_s
    assert lap.is_clean
    assert lap.time_s < 1.07 * limit


@pytest.mark.parametrize(
    ("attempts", "ahead", "sine"),
    [(0.0, NOWHERE, 0.35), (1.0, NOWHERE, 0.65), (9.0, NOWHERE, 0.95), (9.0, 1.0, 0.35)],
)
def test_each_attempt_to_get_free_lets_a_kart_come_back_more_steeply_but_in_a_jam(
    attempts: float, ahead: float, sine: float
) -> None:
    """A metre left of a straight line it turns right until the sine of its angle is this.

    ahead: where the next kart is [m].
    """
    too_flat, too_steep = (
        steering_at(attempts, line_offset=1.0, line_heading=-math.asin(sine) * share, karts_x=ahead)
        for share in (0.9, 1.1)
    )
    assert too_flat < 0.0 < too_steep


def steering_at(attempts: float, **seen: float) -> float:
    """Return how a kart that stands steers. seen: parts of its observation."""
    layout = layout_of("line", 0)
    cockpit = cockpit_for(briefing("line"), layout)
    cockpit.memory[ATTEMPTS] = attempts
    cockpit.observation[layout.slices["line_step"]] = 0.2
    for name, value in seen.items():
        cockpit.observation[layout.slices[name]] = value
    return steering_on_line(cockpit, 0.0, 0.0)
