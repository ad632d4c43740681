"""Ways of vehicles with a trailer into docks: what the planner promises, and driving along them."""

import math
from concurrent.futures import Future
from functools import cache
from itertools import pairwise, product
from pathlib import Path

import numpy as np
import pytest

from race_agents.planning.dock_bench import bench_drive
from race_agents.planning.dock_drive import NOISY, Trouble, Yard, dock_order
from race_agents.planning.dock_tasks import DockTask, dock
from race_agents.planning.parking_plan import chart_of, parked_trailer_pose, plan_to_slot
from race_agents.planning.path_follower import ANGLE, CURVATURE, GEAR, LEFT, SPEED
from race_agents.planning.path_planner import MARGIN
from race_agents.planning.plan_bench import bench_plan
from race_agents.planning.towed_follower import make_towed_track
from race_agents.planning.towed_path import TowedPath, before, behind
from race_agents.planning.towed_planner import TowedPlanner
from race_agents.planning.turn_taking import Passage
from race_agents.planning.way import Way
from race_server.competition.parking_exam import ExamSpec, drive_exam
from race_server.core.free_space.ground import NO_BOXES, Ground
from race_server.core.free_space.prices import Prices
from race_server.core.free_space.towed_ways import find_towed_ways, towed_way
from race_server.core.kernels.boxes import Hull, box_of
from race_server.core.kernels.contacts import box_on_box, box_on_segment
from race_server.core.kernels.geometry import Pose
from race_server.core.state import Floats
from race_server.core.traffic import APART, Traffic
from race_server.core.vehicle_presets import CAR, CAR_TRAILER, LORRY
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError, ScenarioError

TASK = dock(LORRY, pitch=4.0, depth=35.0)
# The rear axle 12 m aside of the bay, 9 m before the noses of the parked trailers.
START = Pose(-12.0, 23.0, 0.1)


@cache
def planner(vehicle: Vehicle = LORRY) -> TowedPlanner:
    return TowedPlanner(vehicle)


@cache
def docked() -> TowedPath:
    return planner().plan(START, 0.1, TASK.goal(LORRY), TASK.walls(), TASK.boxes())


def least_gap(path: TowedPath, vehicle: Vehicle, task: DockTask) -> float:
    """Return a bound of how near [m] vehicle and trailer come to anything, to within 1 cm."""
    trailer, rear = vehicle.trailers[0], behind(path.poses, path.angles, vehicle.trailers[0])
    others = [box_of(Hull(x, y, 0.5 * math.pi, 0.0, a, b, 0)) for x, y, _, _, a, b in task.boxes()]
    middle = vehicle.rear_axle + vehicle.box_offset
    for gap in np.arange(0.0, 0.06, 0.01).tolist():
        front = 0.5 * vehicle.length + gap, 0.5 * vehicle.width + gap
        back = 0.5 * trailer.length + gap, 0.5 * trailer.width + gap
        boxes = [box_of(Hull(*pose, middle, *front, 0)) for pose in path.poses.tolist()]
        boxes += [box_of(Hull(*pose, trailer.box_offset, *back, 1)) for pose in rear.tolist()]
        for box in boxes:
            if any(box_on_segment(box, *wall)[0] > 0.0 for wall in task.walls().tolist()):
                return gap
            if any(box_on_box(box, other)[0] > 0.0 for other in others):
                return gap
    return 0.06


def test_a_plan_ends_in_the_bay_in_line_and_keeps_clear_of_what_stands_there() -> None:
    path = docked()
    assert path.poses[0] == pytest.approx(START)
    assert path.angles[0] == 0.1
    end = behind(path.poses, path.angles, LORRY.trailers[0])[-1]
    # The rear of the trailer 0.50 m before the dock, its axle 4.30 m before its rear.
    assert end == pytest.approx([0.0, 4.8, 0.5 * math.pi], abs=0.05)
    assert abs(path.angles[-1]) < math.radians(3.0)
    assert path.arcs[-1, 1] < 0.0
    assert path.changes <= 2
    assert np.abs(path.arcs[:, 0]).max() <= 0.9 / LORRY.turning_radius + 1e-9
    assert least_gap(path, LORRY, TASK) >= MARGIN - 0.01


def test_the_same_question_gets_the_same_answer() -> None:
    again = TowedPlanner(LORRY).plan(START, 0.1, TASK.goal(LORRY), TASK.walls(), TASK.boxes())
    assert np.array_equal(again.arcs, docked().arcs)
    assert np.array_equal(again.angles, docked().angles)


def test_a_caravan_is_backed_between_others_as_well() -> None:
    task = dock(CAR_TRAILER, pitch=4.0, depth=35.0)
    start = Pose(-12.0 * task.scale, 23.0 * task.scale, 0.0)
    path = planner(CAR_TRAILER).plan(start, 0.0, task.goal(CAR_TRAILER), task.walls(), task.boxes())
    end = behind(path.poses, path.angles, CAR_TRAILER.trailers[0])[-1]
    assert end == pytest.approx(list(task.goal(CAR_TRAILER)), abs=0.05)
    assert least_gap(path, CAR_TRAILER, task) >= MARGIN - 0.01


def test_out_of_place_in_the_bay_it_pulls_out_and_comes_back() -> None:
    # The trailer stands 0.3 m beside its place: nothing but another go brings it there.
    goal, beside = TASK.goal(LORRY), np.array([0.3, 4.8, 0.5 * math.pi])
    start = Pose(*before(beside, np.array(0.0), LORRY.trailers[0]).tolist())
    path = planner().plan(start, 0.0, goal, TASK.walls(), TASK.boxes())
    assert path.arcs[0, 1] > 0.0 > path.arcs[-1, 1]
    assert path.changes == 1


@pytest.mark.parametrize(
    ("start", "angle", "message"),
    [
        (Pose(-12.0, 23.0, 0.1), 1.6, "has an angle of 92° at the hitch, whose limit is 90°"),
        (Pose(-12.0, 8.0, 0.1), 0.0, "is inside of a wall or a box"),
        (Pose(-12.0, 60.0, 0.0), 0.0, "no way leads from .* is cut off from the other"),
    ],
)
def test_what_cannot_be_planned_has_one_clear_error(
    start: Pose, angle: float, message: str
) -> None:
    with pytest.raises(PlanError, match=message):
        planner().plan(start, angle, TASK.goal(LORRY), TASK.walls(), TASK.boxes())


def test_a_yard_too_small_to_turn_in_is_given_up_after_a_number_of_states() -> None:
    task = dock(LORRY, pitch=3.5, depth=18.5)
    # Between the noses at 14.1 m and the wall at 18.5 m a lorry fits, and cannot turn in.
    start = Pose(-12.0, 16.1, 0.0)
    with pytest.raises(PlanError, match=r"found no further state|gave up after \d+ states"):
        planner().plan(start, 0.0, task.goal(LORRY), task.walls(), task.boxes())


def test_a_lorry_that_faces_the_end_of_the_yard_turns_round_before_the_last_bay() -> None:
    # 11 m beside the bay the yard ends, and it is 17.4 m deep: 16.5 m of lorry do not turn at once.
    walls = np.array([(11.0, 0.0, 11.0, 35.0), (-79.0, 0.0, -79.0, 35.0), *TASK.walls()[[0, 2]]])
    boxes = TASK.boxes()[TASK.boxes()[:, 0] < 8.0]
    path = planner().plan(Pose(5.2, 27.7, 0.1), 0.0, TASK.goal(LORRY), walls, boxes)
    end = behind(path.poses, path.angles, LORRY.trailers[0])[-1]
    assert end == pytest.approx([0.0, 4.8, 0.5 * math.pi], abs=0.05)
    assert path.changes >= 2


def test_the_way_round_a_long_wall_is_found_out_of_reach() -> None:
    # From one side of a wall of 60 m to the other, around its end; 24 m to each side are in reach.
    sides = [(-20.0, -40.0), (100.0, -40.0), (100.0, 40.0), (-20.0, 40.0)]
    square = [(*a, *b) for a, b in pairwise([*sides, sides[0]])]
    walls = np.array([*square, (-20.0, 0.0, 60.0, 0.0)])
    path = planner().plan(Pose(10.0, -15.0, 0.0), 0.0, Pose(10.0, 15.0, math.pi), walls)
    assert path.poses[:, 0].max() > 60.0
    assert path.length > 100.0


def test_a_plan_takes_as_many_steps_as_it_is_allowed() -> None:
    lorry = TowedPlanner(LORRY)
    lorry.allow(10)
    with pytest.raises(PlanError, match=r"gave up after \d+ states"):
        lorry.plan(START, 0.1, TASK.goal(LORRY), TASK.walls(), TASK.boxes())
    # A state, and the way in from there, are a step each.
    assert lorry.steps in (10, 11)
    lorry.allow(10_000)
    assert lorry.plan(START, 0.1, TASK.goal(LORRY), TASK.walls(), TASK.boxes()).changes <= 2
    assert 0 < lorry.steps <= 10_000


def test_costs_to_go_are_the_way_on_the_axis_and_a_change_of_direction() -> None:
    goal, ground = Pose(0.0, 0.0, 0.5 * math.pi), Ground()
    walls = 40.0 * np.array([(-1, -1, 1, -1), (1, -1, 1, 1), (1, 1, -1, 1), (-1, 1, -1, -1)])
    obstacles = ground.obstacles(goal, goal, walls, NO_BOXES, reach=25.0, near=3.0)
    distances = ground.distances_to(goal, obstacles, 1.0)
    prices = Prices(1.0, 1.0, 6.0)
    ways = find_towed_ways(obstacles, distances, planner().rig, goal, prices)
    ahead = Pose(0.0, 12.0, 0.5 * math.pi)
    # Back along the axis; what came ahead changes direction first.
    assert towed_way(ways, goal, ahead, -1.0) == pytest.approx(12.0)
    assert towed_way(ways, goal, ahead, 0.0) == pytest.approx(12.0)
    assert towed_way(ways, goal, ahead, 1.0) == pytest.approx(18.0)
    # A circle is the longer way round.
    beside = Pose(6.0, 0.0, 0.5 * math.pi)
    assert 12.0 < towed_way(ways, goal, beside, 0.0) < 60.0


def test_no_way_is_planned_without_a_trailer() -> None:
    with pytest.raises(PlanError, match="'car' draws 0 trailers"):
        TowedPlanner(CAR)


def test_a_slot_is_the_place_of_the_whole_vehicle_standing_straight() -> None:
    order = dock_order(TASK, LORRY)
    assert order.slot.length == pytest.approx(16.5)
    assert parked_trailer_pose(order.slot, LORRY) == pytest.approx(TASK.goal(LORRY))
    path = plan_to_slot(LORRY, START, order, chart_of(order), 0.1)
    assert isinstance(path, TowedPath)
    assert path.arcs == pytest.approx(docked().arcs, abs=1e-9)


# Driving it


def track() -> Floats:
    return make_towed_track(docked(), LORRY, 2.0)


def test_a_track_leads_the_rear_axle_ahead_and_the_trailers_axle_back() -> None:
    points = track()
    assert points[0, :2] == pytest.approx(START[:2])
    assert points[-1, :2] == pytest.approx([0.0, 4.8], abs=0.05)
    ends = points[:, LEFT] == 0.0
    assert np.count_nonzero(ends) == docked().changes + 1
    assert (points[ends, SPEED] == 0.0).all()
    assert points[-1, GEAR] == -1.0
    assert points[-1, ANGLE] == docked().angles[-1]


def test_nowhere_must_the_wheels_turn_faster_than_they_can() -> None:
    ahead = track()[track()[:, GEAR] > 0.0] if (track()[:, GEAR] > 0.0).any() else track()
    angles, steps = np.arctan(ahead[:, CURVATURE] * LORRY.wheelbase), -np.diff(ahead[:, LEFT])
    inside = steps > 0.0
    turning = np.abs(np.diff(angles))[inside] / steps[inside]
    fastest = np.maximum(ahead[1:, SPEED], ahead[:-1, SPEED])[inside]
    assert (turning * fastest).max() <= 0.7 * LORRY.steering_rate + 1e-9


@pytest.mark.parametrize(("last_step", "is_last"), [(0.001, True), (0.1, False)])
def test_a_last_step_of_a_millimetre_need_not_be_driven(last_step: float, is_last: bool) -> None:
    path = TowedPath(Pose(0.0, 0.0, 0.0), np.array([[0.0, -0.1], [0.0, -last_step]]), np.zeros(3))
    assert Way(path, LORRY, 1.0).is_last is is_last


def test_a_lorry_docks_to_within_5_cm_where_all_is_as_it_seems() -> None:
    done = Yard(LORRY, TASK, (START, 0.1), Trouble("none")).drive(np.random.default_rng(0))
    assert done.ending == "docked"
    assert done.plans == 1
    assert math.hypot(done.along, done.across) < 0.05
    assert abs(done.turn) < 0.03


def test_a_lorry_docks_by_noisy_places_of_a_tenth_of_a_second_ago() -> None:
    done = Yard(LORRY, TASK, (START, 0.1), NOISY).drive(np.random.default_rng(0))
    assert done.ending == "docked"
    assert math.hypot(done.along, done.across) < 0.15
    assert abs(done.turn) < 0.1


def test_the_places_of_a_way_are_so_near_that_no_corner_moves_by_more_than_10_cm() -> None:
    announced: list[Floats] = []

    class Heard(Traffic):
        def announce(self, number: int, boxes: Floats) -> bool:
            announced.append(boxes)
            return True

    Passage(Heard(1), 0, track(), LORRY).open()
    x, y, cos, sin, length, width = np.moveaxis(announced[0], -1, 0)
    moved = [
        np.hypot(np.diff(x + a * cos - b * sin, axis=0), np.diff(y + a * sin + b * cos, axis=0))
        for a, b in product((length, -length), (width, -width))
    ]
    assert np.max(moved) <= 1.01 * APART  # in between poses are interpolated
    assert np.max(moved) > 0.9 * APART


def test_two_lorries_dock_and_neither_touches_the_other() -> None:
    for done in drive_exam(ExamSpec("dock-35", seeds=[3, 4], vehicles=2), "valet"):
        assert done.figures["is_success"]


def test_a_car_with_a_trailer_parks_as_straight_as_its_level_asks(tmp_path: Path) -> None:
    """Car and trailer in line within 3°, and the car within 0.15 m: docked well is not enough."""
    lot = tmp_path / "yard.toml"
    lot.write_text(
        "area = [0, 60, 0, 40]\nvehicle = 'car-trailer'\nlimit_s = 120\n"
        "[[rows]]\nat = [20, 33]\ncount = 6\npitch = 4\nheading = 270\nlength = 12\nwidth = 3\n"
        "[[zones]]\nrole = 'start'\nx = [10, 50]\ny = [8, 14]\nspread = 20\nhitch = 20\n"
    )
    for done in drive_exam(ExamSpec(str(lot), seeds=[1, 5, 9]), "valet"):
        assert done.figures["is_success"]


def test_without_a_way_a_lorry_asks_again_after_4_8_16_32_and_64_s(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked = []

    def refuse(*given: object) -> Future[TowedPath]:
        asked.append(given)
        answer: Future[TowedPath] = Future()
        answer.set_exception(PlanError("no way"))
        return answer

    monkeypatch.setattr("race_agents.planning.chauffeur.ask_plan", refuse)
    done = Yard(LORRY, TASK, (START, 0.1), Trouble("none")).drive(np.random.default_rng(0))
    # After 0, 4, 12, 28, 60 and 124 s of 180.
    assert (done.ending, len(asked)) == ("late", 6)


# What is measured


def test_docks_are_counted_as_bays_are() -> None:
    measured = bench_plan(LORRY, runs=1, seed=0, text="pitch 4.00, yard 35")
    (row,) = measured.rows
    assert (row.task, row.solved) == ("dock, pitch 4.00, yard 35.0", 1)


def test_drives_are_counted_under_each_trouble() -> None:
    driven = bench_drive(LORRY, runs=1, seed=0, text="pitch 4.00, yard 35", troubles=(NOISY,))
    (row,) = driven.rows
    assert (row.trouble, row.docked, row.endings) == (NOISY.name, 1, {"docked": 1})
    with pytest.raises(ScenarioError, match="is in the name of no task; these are: dock"):
        bench_drive(LORRY, runs=1, seed=0, text="canal")
