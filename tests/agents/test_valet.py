"""The driver that parks: its sight, its speed before people, its way, its place in a batch."""

import math
import pathlib
import time
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any

import numpy as np
import pytest

from race_agents.drivers.valet import Valet
from race_agents.planning import planner_process
from race_agents.planning.parking_plan import chart_of, driving_time, plan_to_slot
from race_agents.planning.path import Path, path_of
from race_agents.planning.path_follower import make_track
from race_agents.planning.path_planner import PathPlanner
from race_agents.planning.planned_way import planned_way
from race_agents.planning.planner_process import PlannerProcess
from race_agents.planning.shortcuts import cost_of
from race_agents.planning.unexpected import (
    LEAST_SHARE,
    MEMORY_S,
    RESERVE,
    WALK,
    Chart,
    Eye,
    chart_around,
    keep_in_mind,
    safe_speed,
    unexpected_points,
)
from race_server.competition.parking_exam import ExamSpec, drive_exam
from race_server.core.driver import Briefing, driver_named
from race_server.core.free_space.prices import Prices
from race_server.core.kernels.geometry import Pose
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder, Slot, order_of
from race_server.core.state import Floats
from race_server.core.traffic import Traffic
from race_server.core.vehicle_presets import CAR, KART_13, LORRY
from race_server.core.vehicles import vehicle_record
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.presets import parking_task
from race_server.envs.reality_gap import RealityGap
from race_server.errors import DriverError, PlanError
from race_server.scenario.level import level_named

PLANNED = "race_agents.planning.planned_way"
NO_WALLS, NO_BOXES = np.zeros((0, 4)), np.zeros((0, 6))
# 90 rays over a right angle, seen from the origin to the east.
EYE = Eye(0.0, 0.0, 0.0, 0.5 * math.pi, 8.0, 0.7)
RAYS = 91


def seen(ranges: Floats, chart: Chart) -> Floats:
    """Return the points of a scan that are on no map."""
    points = np.zeros((RAYS, 3))
    count = unexpected_points(chart, EYE, ranges, 0, RAYS, 8.0, points)
    return points[:count]


def speed_before(x: float, y: float = 0.0, ago_s: float = 0.0) -> float:
    """Return the safe speed of a kart whose middle starts 0.5 m behind the origin, due east."""
    path = path_of(Pose(-1.022, 0.0, 0.0), np.array([[0.0, 30.0]]))
    track = make_track(path, KART_13, KART_13.top_speed)
    points = np.array([[x, y, ago_s]])
    record = vehicle_record(KART_13)[0]
    return safe_speed(track, np.zeros(1), record, None, points, 1, np.zeros(6))


def order(level: str = "parked", *, heading: float = 0.0, walls: Floats = NO_WALLS) -> ParkingOrder:
    """Return an order to park 20 m east of the origin."""
    slot = Slot(20.0, 0.0, heading, 3.0, 2.0)
    return ParkingOrder(slot, level_named(level), walls, np.zeros((0, 5)))


@pytest.mark.parametrize("x", [20.0, 19.0, 21.0])
def test_a_straight_end_into_a_slot_in_which_something_stands_is_no_way(x: float) -> None:
    # Parked is within half a metre: the last metres are straight, ahead or back.
    task, start = order("report-a-2"), Pose(0.0, 3.0, 0.0)
    assert plan_to_slot(KART_13, start, task, chart_of(task)).length > 19.0
    block = Chart(NO_WALLS, np.array([[x, 0.0, 1.0, 0.0, 0.3, 0.3]]))
    with pytest.raises(PlanError, match=r"the goal, .* is inside of a wall or a box"):
        plan_to_slot(KART_13, start, task, block)


# What it sees


def test_a_wall_of_the_map_is_expected_and_a_person_before_it_is_not() -> None:
    angles = np.linspace(-0.25, 0.25, RAYS) * math.pi
    ranges = 5.0 / np.cos(angles)
    chart = Chart(np.array([[5.0, -9.0, 5.0, 9.0]]), NO_BOXES)
    assert len(seen(ranges, chart)) == 0
    ranges[40:50] = 3.0
    points = seen(ranges, chart)
    assert np.hypot(*points[:, :2].T) == pytest.approx(3.0)
    # The first of ten rays has no neighbour that sees the same.
    assert len(points) == 9


def test_one_ray_alone_is_noise() -> None:
    ranges = np.zeros(RAYS)
    ranges[45] = 3.0
    assert len(seen(ranges, Chart(NO_WALLS, NO_BOXES))) == 0


def test_rays_that_meet_nothing_show_nothing_however_noisy() -> None:
    # A ray that meets nothing reads the reach of 8 m, with noise a little less.
    nothing = 8.0 - np.tile([0.0, 0.01, 0.05, 0.14], RAYS)[:RAYS]
    assert len(seen(nothing, Chart(NO_WALLS, NO_BOXES))) == 0
    # The first of all rays has no neighbour that sees the same.
    assert len(seen(np.full(RAYS, 7.8), Chart(NO_WALLS, NO_BOXES))) == RAYS - 1


def test_a_block_of_the_map_is_expected() -> None:
    ranges = np.zeros(RAYS)
    ranges[44:47] = 3.0
    block = np.array([[3.5, 0.0, 1.0, 0.0, 0.5, 0.5]])
    assert len(seen(ranges, Chart(NO_WALLS, block))) == 0


def test_what_leaves_the_field_of_view_is_kept_in_mind_for_a_while() -> None:
    places = [[0.0, 2.0, 0.5], [2.0, 0.0, 0.5], [0.0, -2.0, MEMORY_S], [0.6, 0.0, 0.5]]
    points = np.zeros((5, 3))
    # Beside it, ahead and in view, beside it for too long, so near that it hides the rest.
    count = keep_in_mind(EYE, np.array(places), 4, 0.1, points, 0)
    assert points[:count, :2].tolist() == [[0.0, 2.0], [0.6, 0.0]]
    assert points[:count, 2] == pytest.approx(0.6)


# How fast it may drive


def test_with_nothing_near_the_speed_is_free() -> None:
    assert speed_before(50.0) == pytest.approx(KART_13.top_speed)


def test_the_nearer_a_person_the_slower() -> None:
    speeds = [speed_before(x) for x in (6.0, 4.0, 3.0, 2.0, 1.0)]
    assert speeds == sorted(speeds, reverse=True)
    assert speeds[0] > speeds[2] > 0.0
    # The nose is about half a metre ahead of the origin.
    assert speeds[-1] == 0.0


def test_it_drives_as_fast_as_it_can_still_stop_to_a_share_of_its_speed() -> None:
    at = [speed_before(x) / KART_13.top_speed for x in np.arange(1.5, 12.0, 0.1)]
    # From a tenth on, what it may drive grows with what is free, without steps that are coarser.
    assert all(share == 0.0 or share >= LEAST_SHARE for share in at)
    assert max(np.diff(sorted(share for share in at if share > 0.0))) < 0.08
    assert at == sorted(at)


def test_a_person_out_of_sight_for_a_second_may_have_come_a_second_nearer() -> None:
    beside = 0.65 + RESERVE + WALK * 1.0
    assert speed_before(-0.5, beside + 2.0, 1.0) > 0.0
    assert speed_before(-0.5, beside - 0.1, 1.0) == 0.0


def test_who_stands_beside_the_way_slows_it_down_and_does_not_stop_it() -> None:
    assert 0.0 < speed_before(2.0, 1.8) < KART_13.top_speed


# Its way


def test_where_half_a_metre_is_enough_the_last_part_of_the_way_is_straight() -> None:
    task = order("report-a-2", heading=1.0)
    path = plan_to_slot(KART_13, Pose(0.0, 0.0, 0.0), task, chart_of(task))
    curvature, way = path.arcs[-1]
    assert curvature == 0.0
    assert abs(way) >= 0.5
    exact = order("parked", heading=1.0)
    bent = plan_to_slot(KART_13, Pose(0.0, 0.0, 0.0), exact, chart_of(exact))
    assert bent.length <= path.length + 1e-6


def test_a_metre_in_reverse_costs_more_so_that_a_kart_turns_round_for_a_long_way() -> None:
    start, goal = Pose(0.0, 0.0, math.pi), Pose(40.0, 0.0, math.pi)
    cheap, dear = PathPlanner(KART_13), PathPlanner(KART_13, back=2.5)
    walls = np.zeros((0, 4))
    assert cheap.plan(start, goal, walls).arcs[:, 1].max() < 0.0  # 40 m backwards
    ways = dear.plan(start, goal, walls).arcs[:, 1]
    assert -ways[ways < 0.0].sum() < 10.0


def test_a_way_costs_its_metres_changes_and_turns_of_the_wheels() -> None:
    arcs = np.array([[0.0, 5.0], [0.5, -2.0]])
    # 5 m ahead, 2 m back for 2 each, one change of direction for 3, one turn to full lock for 1.
    assert cost_of(arcs, Prices(1.0, 2.0), radius=2.0) == pytest.approx(5.0 + 4.0 + 3.0 + 1.0)


def test_ten_metres_straight_take_as_long_as_their_speeds_say() -> None:
    path = Path(Pose(0.0, 0.0, 0.0), np.array([[0.0, 10.0]]))
    track = make_track(path, CAR, 2.0)
    # 5 s at 2 m/s, 1.6 s more to get there, 2 s to brake, and the soft end.
    assert 8.0 < driving_time(track, CAR) < 11.0


@pytest.mark.parametrize("way", [0.001, 0.04, -0.05])
def test_a_way_of_centimetres_is_crept_along(way: float) -> None:
    track = make_track(Path(Pose(0.0, 0.0, 0.0), np.array([[0.0, way]])), CAR, 2.0)
    # As slowly as the car ever drives, 6 cm/s.
    assert driving_time(track, CAR) == pytest.approx(abs(way) / 0.06)


def test_full_lock_before_the_start_takes_a_second_and_a_half() -> None:
    bend = 1.0 / CAR.turning_radius
    straight = make_track(path_of(Pose(0.0, 0.0, 0.0), np.array([[0.0, 3.0]])), CAR, 2.0)
    turned = make_track(path_of(Pose(0.0, 0.0, 0.0), np.array([[bend, 3.0]])), CAR, 2.0)
    assert driving_time(turned, CAR) - driving_time(straight, CAR) == pytest.approx(1.5, abs=0.1)


def test_a_task_without_a_way_has_no_plan(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{PLANNED}.cache_root", lambda: tmp_path)
    walls = np.array([[15.0, -5, 25, -5], [25, -5, 25, 5], [25, 5, 15, 5], [15, 5, 15, -5.0]])
    task = order(walls=walls)
    assert planned_way(KART_13, np.zeros(4), task) is None
    plan = planned_way(KART_13, np.zeros(4), order())
    assert plan is not None
    assert (plan.path_m, plan.direction_changes) == (pytest.approx(20.0, abs=0.1), 0)
    # Both answers are kept: what they depend on is looked for no second time.
    monkeypatch.setattr(f"{PLANNED}.plan_to_slot", None)
    assert planned_way(KART_13, np.zeros(4), task) is None
    assert planned_way(KART_13, np.zeros(4), order()) == plan
    with pytest.raises(TypeError):
        planned_way(KART_13, np.array([0.0, 0.1, 0.0, 0.0]), order())


def test_a_lorry_is_measured_against_the_plan_from_where_its_trailer_stands(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{PLANNED}.cache_root", lambda: tmp_path)
    (one,) = drive_exam(ExamSpec("dock-35", [1]), "valet")
    assert 0.01 < abs(one.start[3]) < math.radians(11.0)
    asked = []
    monkeypatch.setattr(f"{PLANNED}.plan_to_slot", lambda *task: asked.append(task))
    with pytest.raises(AttributeError):
        planned_way(LORRY, one.start, one.order)
    assert asked[0][-1] == one.start[3]


def test_a_plan_is_made_again_where_the_kept_one_is_damaged(
    tmp_path: pathlib.Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{PLANNED}.cache_root", lambda: tmp_path)
    plan = planned_way(KART_13, np.zeros(4), order())
    (file,) = (tmp_path / "plans").iterdir()
    file.write_text('{"plan": {"time_s"', encoding="utf-8")
    assert planned_way(KART_13, np.zeros(4), order()) == plan
    assert planned_way(KART_13, np.zeros(4), order()) == plan


# The driver


def test_its_pace_is_a_speed() -> None:
    assert driver_named("valet:1.5").preset == "lot_lidar"
    for wrong in ("fast", "0", "-1", "nan"):
        with pytest.raises(DriverError, match="give a speed above zero in m/s"):
            driver_named(f"valet:{wrong}")


def test_a_car_parks_by_its_answers_of_a_tenth_of_a_second_ago() -> None:
    spec = ExamSpec("aisle-60", [1, 2], level="precise", delay_s=0.1, noise=0.05)
    tries = {one.seed: one for one in drive_exam(spec, "valet")}
    assert sorted(tries) == [1, 2]
    for one in tries.values():
        assert one.figures["ending"] == "parked", one.figures
        assert np.hypot(*(one.end[:2] - one.order.slot[:2])) < 0.5


def test_a_car_that_changes_its_direction_turns_its_wheels_before_it_drives() -> None:
    # Reversed in, in tasks with three legs and more.
    spec = ExamSpec("aisle-90", [3, 8, 9], level="precise", delay_s=0.1, noise=0.05)
    assert [one.figures["ending"] for one in drive_exam(spec, "valet")] == ["parked"] * 3


def test_wheels_with_5_degrees_of_play_leave_a_car_standing_where_it_is() -> None:
    """It would touch what it passes by 5 cm."""
    spec = ExamSpec("aisle-90", [1], limit_s=40.0, gap=RealityGap(steering_play=(0.12, 0.12)))
    (one,) = drive_exam(spec, "valet")
    assert one.figures["ending"] == "late", one.figures


def test_a_vehicle_that_stands_waits_for_its_plan(monkeypatch: pytest.MonkeyPatch) -> None:
    """An exam goes on with each answer, as a race in lock-step: 0.05 s would be many decisions."""
    spec = ExamSpec("1", seeds=[7])
    (at_once,) = drive_exam(spec, "valet")
    with ThreadPoolExecutor(1) as pool:

        def ask_late(*task: Any) -> "Future[Path]":
            return pool.submit(lambda: (time.sleep(0.05), plan_to_slot(*task))[1])

        monkeypatch.setattr("race_agents.planning.chauffeur.ask_plan", ask_late)
        (late,) = drive_exam(spec, "valet")
    assert late.figures["is_success"]
    assert late.figures["time_s"] <= at_once.figures["time_s"] + 1.0


def test_a_task_is_the_same_alone_and_among_others() -> None:
    alone = next(iter(drive_exam(ExamSpec("2", [5]), "valet")))
    among = {one.seed: one for one in drive_exam(ExamSpec("2", [3, 4, 5]), "valet")}
    assert among[5].figures == alone.figures
    assert among[5].start.tolist() == alone.start.tolist()


def test_valets_drive_among_those_that_learn() -> None:
    task = parking_task("gate", vehicles=2, learners=1, opponents=("valet",))
    batch = Batch(task, after=STAY, seed=3)
    stand = np.array([0.0, 0.0], np.float32)
    for _ in range(1500):
        batch.step(stand)
        if batch.world.parking.parkers[0, 1].parked_tick > 0:
            break
    assert batch.world.parking.parkers[0, 1].parked_tick > 0
    assert batch.world.parking.parkers[0, 0].way < 0.1


def test_a_driver_that_takes_no_order_does_not_drive_in_a_car_park() -> None:
    task = parking_task("gate", vehicles=2, learners=1, opponents=("follow_gap",))
    with pytest.raises(DriverError, match="'follow_gap' cannot park: it takes no order"):
        Batch(task)


def test_without_an_order_it_stands() -> None:
    batch = Batch(parking_task("face-to-face", observation="lot_lidar"), after=STAY)
    driver = driver_named("valet")
    driver.reset(Briefing(0, KART_13, 0, driver.preset, 0.1))
    control = driver.act(Observation(0, batch.layout, batch.observations[0, 0].copy()))
    assert (control.steering, control.throttle, control.brake) == (0.0, 0.0, 1.0)


def test_a_vehicle_whose_way_is_withdrawn_brakes_and_plans_another() -> None:
    batch = Batch(parking_task("face-to-face", observation="lot_lidar"), after=STAY)
    driver, traffic = Valet(), Traffic(1)
    driver.reset(Briefing(0, KART_13, 0, driver.preset, 0.1))
    driver.join(traffic)
    driver.park(order_of(batch.world, 0, 0))

    def answer() -> Control:
        traffic.watch(batch.world, 0)
        seen = batch.observations[0, 0].copy()
        return driver.act(Observation(0, batch.layout, seen))

    while not traffic.has_way(0):
        answer()
    assert answer().throttle > 0.0
    traffic.withdraw(0)
    control = answer()
    assert (control.throttle, control.brake) == (0.0, 1.0)
    while not traffic.has_way(0):
        answer()
    assert answer().throttle > 0.0


@pytest.mark.slow
def test_another_process_plans_the_same_way() -> None:
    task = order(heading=1.0)
    asked = (KART_13, Pose(0.0, 0.0, 0.0), task, chart_of(task))
    planner = PlannerProcess()
    try:
        path = planner.ask(plan_to_slot, asked).result(timeout=300.0)
        assert path.arcs.tolist() == plan_to_slot(*asked).arcs.tolist()
        walls = np.array([[15.0, -5, 25, -5], [25, -5, 25, 5], [25, 5, 15, 5], [15, 5, 15, -5.0]])
        walled = (*asked[:3], Chart(walls, NO_BOXES))
        with pytest.raises(PlanError, match="no way leads from"):
            planner.ask(plan_to_slot, walled).result(timeout=300.0)
        with pytest.raises(PlanError, match="the planner raised ZeroDivisionError"):
            planner.ask(divmod, (1, 0)).result(timeout=300.0)
        assert planner.ask(divmod, (7, 2)).result(timeout=300.0) == (3, 1)
    finally:
        planner.close()


def test_a_planner_that_was_ended_is_started_again() -> None:
    planner_process._process.cache_clear()
    assert planner_process.ask_apart(divmod, 7, 2).result(timeout=300.0) == (3, 1)
    planner_process._process().close()
    assert planner_process.ask_apart(divmod, 9, 2).result(timeout=300.0) == (4, 1)


def test_only_what_is_near_is_looked_for() -> None:
    walls = np.array([[-50.0, 3.0, 50.0, 3.0], [20.0, -9.0, 20.0, 9.0]])
    boxes = np.array([[6.0, 0.0, 1.0, 0.0, 2.0, 1.0], [9.0, 0.0, 1.0, 0.0, 2.0, 1.0]])
    near = chart_around(Chart(walls, boxes), 0.0, 0.0, 5.0)
    assert near.walls.tolist() == walls[:1].tolist()
    assert near.boxes.tolist() == boxes[:1].tolist()
