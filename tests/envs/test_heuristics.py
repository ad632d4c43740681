"""Heuristics of the way to a slot: closed forms, properties, and what they make of a reward."""

import math
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from race_server.core import codes
from race_server.core.kernels.distance_field import Grid
from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.trailers import place_in_line
from race_server.core.lots import PARKER
from race_server.core.stages.lot_draw import put_body
from race_server.core.state import BODY, World
from race_server.core.vehicle_presets import vehicle_named
from race_server.core.vehicles import vehicle_record
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.parking import Parking
from race_server.envs.parking.heuristics.aim import Aim, aim_of
from race_server.envs.parking.heuristics.field import CELL, Field, empty_field, find_ways
from race_server.envs.parking.heuristics.heuristic import CORNERS, SIDES, Chart
from race_server.envs.parking.heuristics.table import HEURISTICS, NUMBERS, way_left
from race_server.envs.parking.obstruction import stands_between
from race_server.envs.parking.reward_terms import TERMS
from race_server.envs.presets import parking_task
from race_server.errors import ScenarioError
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import make_world

TERM = {name: number for number, name in enumerate(TERMS)}
NO_COSTS = (Grid(0.0, 0.0, CELL, 1, 1), np.zeros((1, 1, 1), np.float32))
NO_CHART = Chart(Grid(0.0, 0.0, CELL, 0, 0), np.zeros((0, 0)), *NO_COSTS)
OF_PATHS = ("euclid", "reeds-shepp", "trailer-car", "privileged", "forward")
# The first example may compile.
unhurried = settings(max_examples=40, deadline=None)
places = st.floats(-60.0, 60.0)
poses = st.builds(Pose, places, places, st.floats(-3.1, 3.1))
bends = st.floats(-1.0, 1.0)


def aim(at: Pose, goal: Pose, *, bend: float = 0.0, vehicle: str = "lorry-off-axle") -> Aim:
    """Return the aim of a vehicle whose rear axle has a pose, and is to have another one.

    bend: angle at its hitch [rad].
    """
    body, parker = np.zeros(1, BODY)[0], np.zeros(1, PARKER)[0]
    sizes = vehicle_record(vehicle_named(vehicle))[0]
    for record, pose, ahead in (
        (body, at, sizes.rear_axle),
        (parker, goal, sizes.rear_axle + sizes.box_offset - place_in_line(sizes, 0)),
    ):
        record.x = pose.x + ahead * math.cos(pose.heading)
        record.y = pose.y + ahead * math.sin(pose.heading)
        record.heading = pose.heading
    body.trailers[0].heading = at.heading - bend
    return aim_of(body, sizes, parker)


def way(name: str, seen: Aim, chart: Chart = NO_CHART) -> float:
    return way_left(NUMBERS[name], seen, chart)


def lot_with_ways(lot: str, seed: int, cells: int) -> tuple[World, Field, Chart]:
    world = make_world(parking_scenario(lot), [seed])
    field = empty_field(world.walls, 1, 1, cells)
    find_ways(world, field, 0, 0, 0, cells)
    x0, y0 = field.corners[0, 0].tolist()
    rows, columns = field.ways.shape[2:]
    return world, field, Chart(Grid(x0, y0, CELL, columns, rows), field.ways[0, 0], *NO_COSTS)


@cache
def yard(seed: int) -> tuple[World, Chart]:
    world, _, chart = lot_with_ways("yard-70", seed, CORNERS)
    return world, chart


def aim_at(world: World, x: float, y: float, heading: float) -> Aim:
    """Return the aim of the first vehicle of a world, the middle of its body put to a place."""
    body, sizes = world.bodies[0, 0], world.vehicles[0, 0]
    body.x = x - sizes.box_offset * math.cos(heading)
    body.y = y - sizes.box_offset * math.sin(heading)
    body.heading = heading
    return aim_of(body, sizes, world.parking.parkers[0, 0])


# Closed forms


@unhurried
@given(poses)
def test_parked_straight_no_way_is_left(goal: Pose) -> None:
    for name in OF_PATHS:
        # The cube root of a rounding error of 1e-14 m aside is some 1e-4 m.
        assert way(name, aim(goal, goal)) == pytest.approx(0.0, abs=1e-3)


def test_straight_behind_the_slot_the_way_is_the_distance() -> None:
    for name in OF_PATHS:
        assert way(name, aim(Pose(-10.0, 0.0, 0.0), Pose(0.0, 0.0, 0.0))) == pytest.approx(10.0)
        # Ten metres back are thirty where each counts three times: the mean of 10 and 30.
        back = 20.0 if name == "forward" else 10.0
        assert way(name, aim(Pose(10.0, 0.0, 0.0), Pose(0.0, 0.0, 0.0))) == pytest.approx(back)


@pytest.mark.parametrize(
    ("aside", "radii"), [(0.1, 0.8855), (1.0, 2.6362), (2.0, 3.6470), (4.0, 5.4781)]
)
def test_sideways_a_car_drives_as_reeds_and_shepp_say(aside: float, radii: float) -> None:
    radius = 1.087 / math.tan(0.55)
    seen = aim(Pose(0.0, aside * radius, 0.0), Pose(0.0, 0.0, 0.0), vehicle="kart-13")
    assert way("reeds-shepp", seen) == pytest.approx(radii * radius, abs=1e-4)


def test_a_trailer_is_a_car_with_its_bar_as_wheelbase() -> None:
    # The bar is 7.70 m and the hitch turns by 60° at most: a radius of 4.446 m.
    radius = 7.70 / math.tan(math.radians(60.0))
    seen = aim(Pose(0.0, radius, 0.0), Pose(0.0, 0.0, 0.0))
    assert way("trailer-car", seen) == pytest.approx(2.6362 * radius, abs=1e-3)


def test_a_bent_hitch_costs_the_bar_times_its_angle() -> None:
    goal = Pose(0.0, 0.0, 0.0)
    # The trailer stands where it is to stand, and only the tractor is turned about the hitch.
    bend = 0.2
    hitch = (0.60 + 0.0, 0.0)
    at = Pose(-0.60 + hitch[0] * math.cos(bend), hitch[0] * math.sin(bend), bend)
    seen = aim(at, goal, bend=bend)
    assert seen.last == pytest.approx(seen.goal_last, abs=1e-12)
    assert way("trailer-car", seen) == pytest.approx(7.70 * bend)
    assert way("privileged", seen) == pytest.approx(7.70 * bend, abs=1e-3)


def test_privileged_coordinates_weigh_the_side_by_a_cube_root() -> None:
    # 3 m ahead and 1 m aside with a bar of 7.70 m: 3 + (59.29)^(1/3) = 3 + 3.899.
    seen = aim(Pose(3.0, 1.0, 0.0), Pose(0.0, 0.0, 0.0))
    assert way("privileged", seen) == pytest.approx(3.0 + 59.29 ** (1.0 / 3.0))
    # All in one line and turned by 0.25 rad about the trailer's axle: 7.70 * 0.5.
    turned = Pose(8.30 * math.cos(0.25) - 8.30, 8.30 * math.sin(0.25), 0.25)
    assert way("privileged", aim(turned, Pose(0.0, 0.0, 0.0))) == pytest.approx(3.85, abs=1e-3)


@unhurried
@given(poses, poses, bends)
def test_the_mirror_image_has_the_same_way(at: Pose, goal: Pose, bend: float) -> None:
    mirrored = [pose._replace(y=-pose.y, heading=-pose.heading) for pose in (at, goal)]
    for name in OF_PATHS:
        image = way(name, aim(*mirrored, bend=-bend))
        assert image == pytest.approx(way(name, aim(at, goal, bend=bend)), abs=1e-6)


# Ways over cells


@unhurried
@given(st.floats(-7.0, 73.0), st.floats(-15.0, 15.0), st.floats(-3.1, 3.1), st.integers(0, 3))
def test_the_way_around_walls_is_no_shorter_than_the_straight_one(
    x: float, y: float, heading: float, seed: int
) -> None:
    world, chart = yard(seed)
    seen = aim_at(world, x, y, heading)
    ways = {name: way(name, seen, chart) for name in ("euclid", "grid", "reeds-shepp", "hybrid")}
    assert ways["grid"] >= ways["euclid"] - 1e-9
    assert ways["hybrid"] == max(ways["grid"], ways["reeds-shepp"])
    assert ways["grid"] < 200.0


@pytest.mark.parametrize("lot", ["face-to-face", "zone-30", "yard-70", "aisle-90", "gate"])
def test_in_every_lot_no_way_over_cells_is_left_in_the_slot(lot: str) -> None:
    for name, cells in (("bfs", SIDES), ("grid", CORNERS)):
        for seed in range(2):
            world, _, chart = lot_with_ways(lot, seed, cells)
            parker = world.parking.parkers[0, 0]
            seen = aim_at(world, float(parker.x), float(parker.y), float(parker.heading))
            assert way(name, seen, chart) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("lot", ["grid-150", "dock-35"])
def test_a_lorry_that_stands_straight_in_its_slot_has_no_way_left(lot: str) -> None:
    made = {cells: lot_with_ways(lot, 1, cells) for cells in (SIDES, CORNERS)}
    for name, heuristic in HEURISTICS.items():
        if heuristic.has_atlas:  # see test_cost_to_go.py
            continue
        world, _, chart = made[heuristic.cells or SIDES]
        parker = world.parking.parkers[0, 0]
        put_body(world, 0, 0, parker.x, parker.y, parker.heading)
        seen = aim_of(world.bodies[0, 0], world.vehicles[0, 0], parker)
        assert way(name, seen, chart) == pytest.approx(0.0, abs=1e-3), name


def test_breadth_first_search_goes_in_whole_metres_from_side_to_side() -> None:
    world, _, chart = lot_with_ways("face-to-face", 0, SIDES)
    parker = world.parking.parkers[0, 0]
    x, y = float(parker.x), float(parker.y)
    assert way("bfs", aim_at(world, x - 5.0, y, 0.0), chart) == 5.0
    assert way("bfs", aim_at(world, x - 5.4, y + 0.4, 0.0), chart) == 5.0
    assert way("bfs", aim_at(world, x - 5.0, y + 2.0, 0.0), chart) == 7.0


def test_before_a_gate_the_way_is_longer_than_the_straight_line() -> None:
    for seed in range(20):
        world, _, chart = lot_with_ways("gate", seed, CORNERS)
        seen = aim_of(world.bodies[0, 0], world.vehicles[0, 0], world.parking.parkers[0, 0])
        ends = (seen.middle.x, seen.middle.y, seen.goal_middle.x, seen.goal_middle.y)
        if stands_between(world, 0, *ends):
            assert way("grid", seen, chart) > 1.02 * way("euclid", seen)
            return
    raise AssertionError("no start is behind a wall")


def test_a_field_is_kept_until_an_obstacle_moves() -> None:
    world, field, chart = lot_with_ways("yard-70", 3, CORNERS)
    known = chart.ways.copy()
    chart.ways[:] = 7.0
    find_ways(world, field, 0, 0, 0, CORNERS)
    assert (chart.ways == 7.0).all()
    for block in world.parking.blocks[0]:
        block.kind = codes.NOTHING
    find_ways(world, field, 0, 0, 0, CORNERS)
    assert (chart.ways <= known + 1e-9).all()
    assert chart.ways.sum() < known.sum()


def test_a_block_stands_between_two_places_only_if_it_is_on_their_line() -> None:
    world = make_world(parking_scenario("yard-70"), [1])
    for block in world.parking.blocks[0]:
        block.kind = codes.NOTHING
    assert not stands_between(world, 0, 10.0, 0.0, 50.0, 0.0)
    assert not stands_between(world, 0, 10.0, 0.0, 10.0, 0.0)
    block = world.parking.blocks[0, 0]
    block.x, block.y, block.heading, block.half_length, block.half_width = 30.0, 0.8, 0.0, 2.0, 1.0
    block.kind = codes.OBSTACLE
    assert stands_between(world, 0, 10.0, 0.0, 50.0, 0.0)
    assert not stands_between(world, 0, 10.0, -1.0, 50.0, -1.0)
    assert not stands_between(world, 0, 10.0, 0.0, 27.0, 0.0)
    assert stands_between(world, 0, 10.0, 0.0, 10.0, 60.0)  # the wall around the yard


# Rewards


def face_to_face(**options: object) -> Batch:
    return Batch(parking_task("face-to-face", reward={"goal_progress": 1.0}, **options), after=STAY)


def ways_and_rewards(batch: Batch) -> tuple[list[float], list[float]]:
    """Drive straight ahead to the slot; return the ways left before and after each decision."""
    ways, rewards = [float(batch.buffers.before["way"][0, 0])], []
    while not batch.buffers.idle[0, 0]:
        batch.step(np.array((1.0, 0.0), np.float32))
        ways.append(float(batch.buffers.terms[0, 0, TERM["goal_way"]]))
        rewards.append(float(batch.buffers.terms[0, 0, TERM["goal_progress"]]))
    assert batch.terminated[0, 0]
    return ways, rewards


def test_differences_add_up_to_the_way_that_was_driven() -> None:
    ways, rewards = ways_and_rewards(face_to_face(heuristic="grid"))
    assert ways[0] == pytest.approx(5.0)
    assert sum(rewards) == pytest.approx(ways[0] - ways[-1])


def test_the_discounted_sum_of_a_potential_is_the_way_at_the_start() -> None:
    ways, rewards = ways_and_rewards(face_to_face(shaping="potential", discount=0.9))
    total = sum(0.9**step * reward for step, reward in enumerate(rewards))
    assert total == pytest.approx(5.0)
    assert rewards[-1] == pytest.approx(ways[-2])  # at the end the potential is 0


def test_a_difference_is_a_potential_and_a_penalty_of_the_way_left() -> None:
    ways, differences = ways_and_rewards(face_to_face())
    same, potentials = ways_and_rewards(face_to_face(shaping="potential", discount=0.9))
    assert same == ways
    for difference, potential, left in zip(
        differences[:-1], potentials[:-1], ways[1:-1], strict=True
    ):
        assert difference == pytest.approx(potential - (1.0 - 0.9) * left)


def test_hurl_leaves_the_reward_as_it_is_and_tells_the_way() -> None:
    ways, rewards = ways_and_rewards(face_to_face(shaping="hurl"))
    assert set(rewards) == {0.0}
    assert ways == ways_and_rewards(face_to_face())[0]


def test_without_a_heuristic_nothing_is_gained() -> None:
    assert set(ways_and_rewards(face_to_face(heuristic="none"))[1]) == {0.0}


def test_threads_share_no_ways() -> None:
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (30, 6, 1, 2)).astype(np.float32)
    sums = []
    for threads in (1, 3):
        task = parking_task("yard-70", heuristic="hybrid", reward={"goal_way": 1.0})
        batch = Batch(task, worlds=6, seed=5, threads=threads)
        sums.append([batch.rewards.copy() for action in actions if batch.step(action) is None])
        batch.close()
    assert np.array_equal(sums[0], sums[1])


def test_a_heuristic_that_does_not_exist_is_refused_in_a_sentence() -> None:
    known = ", ".join(HEURISTICS)
    with pytest.raises(ScenarioError, match=f"heuristic 'astar' is unknown; choose one of {known}"):
        Parking(heuristic="astar")
    with pytest.raises(ScenarioError, match="shaping 'sum' is unknown; choose one of difference"):
        Parking(shaping="sum")


def test_a_heuristic_of_trailers_is_refused_without_one() -> None:
    with pytest.raises(
        ScenarioError,
        match=r"'trailer-car' is for vehicles with one trailer, and 'kart-13' draws 0; choose one "
        "of none, euclid, bfs, grid, reeds-shepp, hybrid",
    ):
        Batch(parking_task("yard-70", heuristic="trailer-car"))
