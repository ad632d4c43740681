"""The planner of paths: what it promises about walls, goals and its errors."""

import math
from contextlib import suppress
from functools import cache
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from race_agents.planning.halfway import cells_down
from race_agents.planning.parking_tasks import ParkingTask, bay, parallel
from race_agents.planning.path import Path, driven_back, path_of
from race_agents.planning.path_planner import EAGER_SHARE, MARGIN, PathPlanner
from race_agents.planning.plan_picture import plot_plans
from race_agents.planning.search_tree import (
    NODES,
    NONE,
    clear_tree,
    dequeue,
    keep_draft,
    make_tree,
    next_node,
)
from race_server.competition.proportion import wilson_interval
from race_server.core.free_space.footprint import Point, box_at, convert, footprint_of
from race_server.core.free_space.obstacles import Obstacles, free_way, is_free, survey
from race_server.core.kernels.contacts import box_on_segment
from race_server.core.kernels.distance_field import Grid
from race_server.core.kernels.geometry import Pose
from race_server.core.state import Floats
from race_server.core.vehicle_presets import CAR, KART_13
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError, ScenarioError

NO_BOXES = np.zeros((0, 6))
REVERSE = bay(width=2.5, aisle=6.0, forward=False)
FORWARD = bay(width=2.5, aisle=6.0, forward=True)
BEFORE_IT = Pose(-6.0, 3.0, 0.0)  # in the aisle, facing east


@cache
def planner() -> PathPlanner:
    return PathPlanner(CAR)


def parked(task: ParkingTask, start: Pose = BEFORE_IT) -> Path:
    return planner().plan(start, task.goal(CAR), task.walls())


def yard(*boxes: tuple[float, ...]) -> tuple[Floats, Floats]:
    """Return walls 40 by 20 m around the origin, and boxes."""
    corners = [(-20, -10), (20, -10), (20, 10), (-20, 10)]
    walls = [(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    return np.array(walls, float), np.array(boxes, float).reshape(-1, 6)


def least_gap(path: Path, walls: Floats, vehicle: Vehicle = CAR) -> float:
    """Return a bound of how near [m] the vehicle comes to walls, to within 5 mm."""
    poses = [Pose(*map(float, pose)) for pose in path.sampled(0.02).poses]
    for margin in np.arange(0.0, 0.2, 0.005):
        body = footprint_of(vehicle, margin, 1.0)
        boxes = [box_at(body, pose) for pose in poses]
        if any(box_on_segment(box, *wall)[0] > 0.0 for box in boxes for wall in walls.tolist()):
            return float(margin)
    return 0.2


def test_three_points_of_a_kart_lie_on_one_line() -> None:
    # The centre of gravity 0.435 m ahead of the rear axle, the middle 0.087 m ahead of that.
    north = np.array([1.0, 2.0, 0.5 * math.pi])
    gravity = convert(north, KART_13, Point.REAR_AXLE, Point.GRAVITY)
    assert gravity == pytest.approx([1.0, 2.435, 0.5 * math.pi])
    assert convert(gravity, KART_13, Point.GRAVITY, Point.MIDDLE) == pytest.approx(
        [1.0, 2.522, 0.5 * math.pi]
    )
    assert convert(gravity, KART_13, Point.GRAVITY, Point.REAR_AXLE) == pytest.approx(north)


def test_the_box_of_the_car_reaches_from_bumper_to_bumper() -> None:
    # Overhangs: 0.929 m behind the rear axle, 2.80 + 0.96 m ahead of it.
    body = footprint_of(CAR, 0.0, 1.0)
    assert body.middle - body.half_length == pytest.approx(-0.929)
    assert body.middle + body.half_length == pytest.approx(3.76)
    assert body.radius == pytest.approx(3.0056, abs=1e-4)


def obstacles_around(walls: Floats) -> Obstacles:
    grid = Grid(-20.0, -10.0, 0.25, 160, 80)
    obstacles = Obstacles(grid, np.zeros((80, 160)), walls, NO_BOXES)
    survey(obstacles, 2.0)
    return obstacles


@settings(max_examples=200, deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(-4.5, 6.0), st.floats(-math.pi, math.pi))
@example(0.0, -1.0845, -0.5 * math.pi)  # parked forward, 15 cm before the end of the bay
def test_the_grid_decides_as_the_contacts_do(x: float, y: float, heading: float) -> None:
    walls, body, pose = REVERSE.walls(), footprint_of(CAR, MARGIN, 1.0), Pose(x, y, heading)
    box = box_at(body, pose)
    touches = any(box_on_segment(box, *wall)[0] > 0.0 for wall in walls.tolist())
    free = is_free(obstacles_around(walls), body, pose)
    # Wholly behind a wall nothing is touched, and far from all walls discs are enough.
    assert free == (not touches)


def test_a_way_ends_a_centimetre_before_the_wall() -> None:
    # From 0 ahead: the bumper 3.76 m ahead of the axle, the wall at 10.
    obstacles = obstacles_around(np.array([[10.0, -5.0, 10.0, 5.0]]))
    way = free_way(obstacles, footprint_of(CAR, 0.0, 1.0), Pose(0.0, 0.0, 0.0), 0.0, 9.0)
    assert 6.24 - 0.01 <= way <= 6.24
    back = free_way(obstacles, footprint_of(CAR, 0.0, 1.0), Pose(0.0, 0.0, 0.0), 0.0, -5.0)
    assert back == -5.0


@pytest.mark.parametrize(
    ("task", "changes"),
    [
        (REVERSE, 1),
        (FORWARD, 2),
        (parallel(1.25 * CAR.length, name="1.25 L"), 4),
        (parallel(CAR.length + 0.6, name="L + 0.6"), 16),
    ],
    ids=lambda value: getattr(value, "name", None),
)
def test_a_plan_ends_in_the_slot_and_keeps_clear_of_walls(task: ParkingTask, changes: int) -> None:
    start = BEFORE_IT._replace(y=0.5 * task.aisle)
    path = parked(task, start)
    assert path.start == start
    assert path.poses[-1][:2] == pytest.approx(task.goal(CAR)[:2], abs=1e-6)
    assert math.remainder(path.poses[-1][2] - task.heading, 2.0 * math.pi) == pytest.approx(0.0)
    assert np.abs(path.arcs[:, 0]).max() <= 1.0 / CAR.turning_radius + 1e-9
    # Between the poses that were looked at, a corner comes 3 mm nearer.
    assert least_gap(path, task.walls()) >= MARGIN - 0.005
    assert path.changes <= changes


def test_the_same_question_gets_the_same_answer() -> None:
    path = parked(FORWARD)
    assert np.array_equal(parked(FORWARD).arcs, path.arcs)
    other = PathPlanner(CAR).plan(BEFORE_IT, FORWARD.goal(CAR), FORWARD.walls())
    assert np.array_equal(other.arcs, path.arcs)


def test_out_of_the_slot_is_as_easy_as_into_it() -> None:
    path = planner().plan(REVERSE.goal(CAR), BEFORE_IT, REVERSE.walls())
    assert path.poses[-1] == pytest.approx([*BEFORE_IT[:2], path.poses[-1][2]], abs=1e-6)
    assert least_gap(path, REVERSE.walls()) >= MARGIN - 0.005


def test_from_slot_to_slot_two_searches_meet_in_the_aisle() -> None:
    # Two bays 12 m apart, out of one forward and into the other forward: each end is narrow.
    line = [(-20, 5), (-20, 0), (-7.25, 0), (-7.25, -5), (-4.75, -5), (-4.75, 0)]
    line += [(4.75, 0), (4.75, -5), (7.25, -5), (7.25, 0), (20, 0), (20, 5)]
    walls = np.array([(*a, *b) for a, b in zip(line, line[1:] + line[:1], strict=True)], float)
    goal = bay(width=2.5, aisle=5.0, forward=True).goal(CAR)
    start, goal = goal._replace(x=-6.0), goal._replace(x=6.0)
    path = planner().plan(start, goal, walls)
    assert path.start == start
    assert path.poses[-1][:2] == pytest.approx(goal[:2], abs=1e-6)
    assert least_gap(path, walls) >= MARGIN - 0.005


def test_the_way_down_a_field_ends_at_its_lowest_cell() -> None:
    field = np.add.outer(np.arange(4.0), np.arange(5.0))
    assert cells_down(field, (3, 4)) == [(3, 4), (2, 3), (1, 2), (0, 1), (0, 0)]


def test_without_obstacles_the_car_just_drives_there() -> None:
    walls, boxes = yard()
    path = planner().plan(Pose(-5.0, 0.0, 0.0), Pose(5.0, 0.0, 0.0), walls, boxes)
    assert path.arcs == pytest.approx(np.array([[0.0, 10.0]]))
    assert path.changes == 0


def test_a_box_in_the_way_is_driven_around() -> None:
    # A parked car across, 2 m by 5 m, in the middle of a way of 20 m.
    walls, boxes = yard((0.0, 0.0, 0.0, 1.0, 2.5, 1.0))
    path = planner().plan(Pose(-10.0, 0.0, 0.0), Pose(10.0, 0.0, 0.0), walls, boxes)
    assert path.changes == 0
    assert 20.5 < path.length < 26.0
    middle = path.poses[np.argmin(np.abs(path.poses[:, 0]))]
    assert abs(middle[1]) > 2.5 + 0.5 * CAR.width


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_a_pose_that_is_no_place_is_no_start_and_no_goal(number: float) -> None:
    walls, boxes = yard()
    with pytest.raises(PlanError, match=rf"the goal, \({number:.2f} m, .*: give finite numbers"):
        planner().plan(Pose(0.0, 0.0, 0.0), Pose(number, 0.0, 0.0), walls, boxes)


def test_a_pose_inside_a_wall_or_a_box_is_no_start_and_no_goal() -> None:
    walls, boxes = yard((0.0, 0.0, 1.0, 0.0, 5.0, 5.0))
    outside, inside = Pose(-15.0, 0.0, 0.0), Pose(-1.0, 0.0, 0.0)
    with pytest.raises(PlanError, match=r"the goal, \(-1.00 m, 0.00 m, 0°\), is inside of a wall"):
        planner().plan(outside, inside, walls, boxes)
    with pytest.raises(PlanError, match="the start"):
        planner().plan(inside, outside, walls, boxes)


def test_a_pose_nearer_to_a_wall_than_the_margin_is_told_apart() -> None:
    # 3 cm between the car's left side and the wall at y 10.
    near = Pose(0.0, 10.0 - 0.5 * CAR.width - 0.03, 0.0)
    with pytest.raises(PlanError, match=r"nearer to an obstacle than the margin of 0\.05 m"):
        planner().plan(Pose(-10.0, 0.0, 0.0), near, *yard())
    closer = PathPlanner(CAR, margin=0.02)
    assert closer.plan(Pose(-10.0, 0.0, 0.0), near, *yard()).poses[-1][1] == pytest.approx(near.y)


def test_a_goal_behind_a_closed_wall_is_reported_at_once() -> None:
    walls, _ = yard()
    across = np.array([[0.0, -10.0, 0.0, 10.0]])
    with pytest.raises(PlanError, match="no way leads from"):
        planner().plan(Pose(-10.0, 0.0, 0.0), Pose(8.0, 0.0, 0.0), np.concatenate([walls, across]))


def test_a_way_round_a_wall_is_found_though_it_leads_far_aside() -> None:
    # A wall of 60 m between start and goal, which are 10 m apart: 30 m to each side of them.
    sides = [(-45.0, -20.0), (45.0, -20.0), (45.0, 30.0), (-45.0, 30.0)]
    square = [(*a, *b) for a, b in pairwise([*sides, sides[0]])]
    walls = np.array([*square, (-30.0, 5.0, 30.0, 5.0)])
    path = planner().plan(Pose(0.0, 0.0, 0.0), Pose(0.0, 10.0, math.pi), walls)
    assert np.abs(path.poses[:, 0]).max() > 25.0
    assert path.poses[-1][:2] == pytest.approx([0.0, 10.0], abs=0.05)


def test_a_slot_25_cm_longer_than_the_car_is_too_short() -> None:
    task = parallel(CAR.length + 0.25, name="L + 0.25")
    with pytest.raises(PlanError, match="found no further state; make the slot or the aisle wider"):
        parked(task, BEFORE_IT._replace(y=1.75))


def test_a_plan_takes_no_more_steps_than_it_is_allowed() -> None:
    bounded = PathPlanner(CAR)
    goal, walls = FORWARD.goal(CAR), FORWARD.walls()
    path, needed = bounded.plan(BEFORE_IT, goal, walls), bounded.steps
    assert needed > 10
    bounded.allow(needed // 2)
    # Half of the steps may be enough for a way that is worse, or for none; never for more steps.
    with suppress(PlanError):
        bounded.plan(BEFORE_IT, goal, walls)
    assert bounded.steps <= needed // 2 + 1
    bounded.allow(3)
    with pytest.raises(PlanError, match="gave up after"):
        bounded.plan(BEFORE_IT, goal, walls)
    # Of twice as many the greedier search is left a quarter.
    bounded.allow(2 * needed)
    assert bounded.plan(BEFORE_IT, goal, walls).arcs.tolist() == path.arcs.tolist()


def test_a_kart_parks_in_its_slot() -> None:
    # 2.00 m by 3.00 m: closed forms say that 3.54 m of aisle do for a slot of 1.80 m.
    task = ParkingTask("kart", 2.0, 3.0, 3.6, 1.5, -0.5 * math.pi, 0.3, 0.1, both_ways=True)
    path = PathPlanner(KART_13).plan(Pose(-5.0, 1.8, 0.0), task.goal(KART_13), task.walls())
    assert least_gap(path, task.walls(), KART_13) >= MARGIN - 0.005


def test_a_path_driven_back_leads_to_its_start() -> None:
    path = path_of(Pose(1.0, 2.0, 0.3), np.array([[0.2, 3.0], [-0.1, 2.0], [0.3, -1.0]]))
    back = driven_back(path)
    assert back.poses[::-1] == pytest.approx(path.poses)
    assert back.arcs.tolist() == [[0.3, 1.0], [-0.1, -2.0], [0.2, -3.0]]
    assert (path.length, path.changes) == (6.0, 1)


def test_where_steps_run_out_the_last_quarter_of_them_finds_a_longer_way() -> None:
    # Through a gate of 3.5 m, and backwards into the only bay of 16 that is free.
    corners = [(0, 0), (60, 0), (60, 40), (0, 40)]
    walls = [(*a, *b) for a, b in zip(corners, corners[1:] + corners[:1], strict=True)]
    walls += [(20, 0, 20, 18.25), (20, 21.75, 20, 40)]
    bays = [(x, 11.25 + 2.5 * number) for x in (40.5, 51.5) for number in range(8)]
    parked = [(*bay, 1.0, 0.0, 2.35, 0.95) for bay in bays if bay != (51.5, 13.75)]
    task = Pose(11.7, 7.35, 0.1), Pose(52.92, 13.75, math.pi), np.array(walls), np.array(parked)
    bounded = PathPlanner(CAR, back=2.0)
    best, needed = bounded.plan(*task), bounded.steps
    allowed = 4000
    assert (1.0 - EAGER_SHARE) * allowed < needed
    bounded.allow(allowed)
    way = bounded.plan(*task)
    assert (1.0 - EAGER_SHARE) * allowed < bounded.steps < allowed
    assert best.length < way.length < 1.1 * best.length
    assert least_gap(way, task[2]) > 0.0


def test_arcs_that_are_one_are_joined() -> None:
    arcs = np.array([[0.2, 1.0], [0.2, 1.0], [0.2, -1.0], [0.0, 0.0], [0.0, -2.0]])
    assert path_of(Pose(0.0, 0.0, 0.0), arcs).arcs.tolist() == [
        [0.2, 2.0],
        [0.2, -1.0],
        [0.0, -2.0],
    ]


def test_samples_lie_on_the_path_and_hold_its_ends() -> None:
    path = path_of(Pose(0.0, 0.0, 0.0), np.array([[0.0, 1.0], [0.5, -0.7]]))
    samples = path.sampled(0.3)
    assert samples.ways == pytest.approx([0.25] * 4 + [-0.7 / 3] * 3)
    assert samples.curvatures.tolist() == [0.0] * 4 + [0.5] * 3
    assert samples.poses[4] == pytest.approx([1.0, 0.0, 0.0])
    assert samples.poses[-1] == pytest.approx(path.poses[-1])
    assert samples.of(CAR, Point.GRAVITY)[0] == pytest.approx([1.54, 0.0, 0.0])


@settings(deadline=None)
@given(st.lists(st.integers(0, 9), max_size=40))
def test_the_queue_gives_the_least_estimate_and_of_two_the_older_one(
    estimates: list[int],
) -> None:
    tree = make_tree(64)
    clear_tree(tree)
    for number, estimate in enumerate(estimates):
        node = tree.nodes[tree.counts[NODES]]
        node.estimate, node.cost, node.cell = estimate, 0.0, number
        keep_draft(tree)
    order = [dequeue(tree) for _ in estimates]
    assert order == sorted(range(len(estimates)), key=lambda number: (estimates[number], number))


@settings(deadline=None)
@given(st.lists(st.tuples(st.integers(-3, 3), st.integers(0, 20)), max_size=40))
def test_of_each_cell_only_the_cheapest_node_is_expanded(found: list[tuple[int, int]]) -> None:
    tree = make_tree(64)
    clear_tree(tree)
    for cell, cost in found:
        node = tree.nodes[tree.counts[NODES]]
        # Cells far apart, some of which share a place in the table.
        node.cell, node.cost, node.estimate = cell << 40, cost, cost
        keep_draft(tree)
    expanded = {}
    while (number := next_node(tree)) != NONE:
        node = tree.nodes[number]
        assert node.cell >> 40 not in expanded
        expanded[node.cell >> 40] = node.cost
    assert expanded == {cell: min(cost for c, cost in found if c == cell) for cell, _ in found}
    assert tree.counts[NODES] <= len(found)


@pytest.mark.parametrize(
    ("successes", "runs", "low", "high"),
    [
        (0, 0, 0.0, 1.0),
        (10, 10, 0.7225, 1.0),
        (5, 10, 0.2366, 0.7634),
        (2165, 2209, 0.9734, 0.9851),
    ],
)
def test_the_interval_of_a_share_is_that_of_wilson(
    successes: int, runs: int, low: float, high: float
) -> None:
    assert wilson_interval(successes, runs) == pytest.approx((low, high), abs=1e-4)


def test_the_picture_of_a_plan_is_written(tmp_path: FilePath) -> None:
    path = parked(REVERSE)
    plot_plans(CAR, [(REVERSE, path)], tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 10_000
    with pytest.raises(ScenarioError, match="cannot be written"):
        plot_plans(CAR, [(REVERSE, path)], tmp_path / "no folder" / "plan.png")
