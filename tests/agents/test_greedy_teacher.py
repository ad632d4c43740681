"""A teacher that knows the costs to go: its labels lead a car into its slot."""

from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest

from race_agents.planning.greedy import KEPT, SETTLED, Guide, choose, cost_from, is_settled
from race_agents.planning.guides import alike_slots
from race_agents.training.greedy_teacher import GreedyTeacher
from race_agents.training.imitation import School
from race_agents.training.settings_toml import read_settings
from race_server.core.free_space.ground import NO_BOXES, Ground
from race_server.core.free_space.rig import Towed, rig_of_car
from race_server.core.free_space.state_costs import find_state_costs
from race_server.core.free_space.states import (
    AHEAD,
    BACK,
    UNKNOWN,
    cost_to_go,
    is_among,
)
from race_server.core.kernels.geometry import Pose
from race_server.core.vehicle_presets import vehicle_named
from race_server.core.vehicles import Vehicle
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.parking.heuristics.atlas import goal_in
from race_server.envs.presets import parking_task
from race_server.errors import ScenarioError
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import make_world

# The kernels of costs take a minute to compile, and few other tests call them.
pytestmark = pytest.mark.slow

CAR = vehicle_named("car")
GOAL = Pose(0.0, 0.0, 0.0)
# A bay between walls, its end 1.2 m behind the rear axle, and an aisle before it.
WALLS = np.array(
    [
        [-1.2, -1.4, -1.2, 1.4],
        [-1.2, -1.4, 3.6, -1.4],
        [-1.2, 1.4, 3.6, 1.4],
        [3.6, -5.0, 3.6, -1.4],
        [3.6, 1.4, 3.6, 5.0],
        [9.6, -5.0, 9.6, 5.0],
    ]
)


@cache
def bay() -> Guide:
    """Return what is known of a car on the way to the bay."""
    rig = rig_of_car(CAR, 0.08, 0.98)
    corner, other = Pose(-1.2, -5.0, 0.0), Pose(9.6, 5.0, 0.0)
    obstacles = Ground().obstacles(corner, other, WALLS, NO_BOXES, reach=0.5, near=2.0)
    costs = find_state_costs(obstacles, rig, GOAL, rate=1.0, cusp=2.0)
    return Guide(costs, costs, obstacles, rig, GOAL)


def cost(x: float, y: float, degrees: float = 0.0, gear: int = BACK) -> float:
    towed = Towed(x, y, np.radians(degrees), 0.0, 0.0)
    return cost_to_go(bay().costs, GOAL, towed, gear)


def test_straight_before_its_place_a_car_has_only_to_reverse() -> None:
    assert cost(3.0, 0.0) == pytest.approx(3.0, abs=0.5)
    assert choose(bay(), Towed(3.0, 0.0, 0.0, 0.0, 0.0), BACK)[:2] == (BACK, 0.0)


def test_to_turn_round_first_costs_a_change_of_direction() -> None:
    assert cost(3.0, 0.0, gear=AHEAD) > cost(3.0, 0.0) + 2.0


def test_a_centimetre_aside_costs_a_little_and_more_aside_costs_more() -> None:
    assert cost(2.0, 0.0) < cost(2.0, 0.03) < cost(2.0, 0.1) < cost(2.0, 0.2)


def test_left_costs_what_right_costs() -> None:
    assert cost(6.0, 1.5, 30.0) == pytest.approx(cost(6.0, -1.5, -30.0), rel=1e-3)


def test_where_there_is_a_wall_nothing_is_known() -> None:
    assert cost(1.0, 1.4) >= UNKNOWN


def test_finer_cells_cost_the_same_way_as_much() -> None:
    rig = rig_of_car(CAR, 0.08, 0.98)
    walls = np.array([[-1.5, -1.5, 4.5, -1.5], [-1.5, 1.5, 4.5, 1.5]])
    corner, other = Pose(-1.5, -1.5, 0.0), Pose(4.5, 1.5, 0.0)
    obstacles = Ground().obstacles(corner, other, walls, NO_BOXES, reach=0.5, near=2.0)
    found = find_state_costs(obstacles, rig, GOAL, rate=1.0, cusp=2.0, cell=0.25)
    # 0.25 of 7.7 are 0.09 of 2.8 m.
    assert found.grid.cell == pytest.approx(0.0909, abs=1e-4)
    ahead = Towed(2.0, 0.0, 0.0, 0.0, 0.0)
    assert cost_to_go(found, GOAL, ahead, BACK) == pytest.approx(2.0, abs=0.5)


def test_coarse_cells_lead_to_finer_ones_around_the_place_and_change_none_of_them() -> None:
    known = bay()
    found = partial(find_state_costs, known.obstacles, known.rig, GOAL, rate=1.0, cusp=2.0)
    near = found(reach=8.0)  # 2.9 m for a car
    far = found(cell=1.0, finer=near)
    close, away = Towed(2.0, 0.0, 0.0, 0.0, 0.0), Towed(4.5, 0.0, 0.0, 0.0, 0.0)
    assert is_among(near, GOAL, close)
    assert not is_among(near, GOAL, away)
    # A coarse cell is 0.36 m.
    assert cost_to_go(far, GOAL, close, BACK) == pytest.approx(
        cost_to_go(near, GOAL, close, BACK), abs=0.4
    )
    assert cost_to_go(far, GOAL, away, BACK) == pytest.approx(4.5, abs=0.1)
    guide = Guide(near, far, known.obstacles, known.rig, GOAL)
    assert cost_from(guide, close, BACK) == cost_to_go(near, GOAL, close, BACK)
    assert cost_from(guide, away, BACK) == cost_to_go(far, GOAL, away, BACK)
    assert choose(guide, away, BACK)[:2] == (BACK, 0.0)


# The same bay in a lot: its slot is reversed into from an aisle.
LOT = """
area = [0, 15, 0, 11]
vehicle = "car"
level = "parked"
limit_s = 60
[[rows]]
at = [7.5, 2.5]
heading = 90
length = 5.0
width = 2.5
[[zones]]
role = "start"
x = [3, 4]
y = [8, 8]
[taken]
share = 1.0
"""


def aisle(folder: Path, action: str = "crawl") -> Batch:
    """Return two cars before their bays."""
    file = folder / "bay.toml"
    file.write_text(LOT)
    task = parking_task(str(file), observation="dock", action=action)
    return Batch(task, worlds=2, seed=7, after=STAY)


def test_a_car_stops_well_within_its_level_and_stays_where_it_is_just_within(
    tmp_path: Path,
) -> None:
    world = aisle(tmp_path).world
    body, vehicle, parker = world.bodies[0, 0], world.vehicles[0, 0], world.parking.parkers[0, 0]
    goal = goal_in(world.parking.lots.slots[0], CAR)  # it points to the north
    body["y"], body["heading"] = goal.y + vehicle["rear_axle"], goal.heading
    stops, stays = [], []
    for aside in (0.09, 0.13, 0.16):  # of 0.15 m
        body["x"] = goal.x - aside
        stops.append(is_settled(parker, vehicle, body, SETTLED))
        stays.append(is_settled(parker, vehicle, body, KEPT))
    assert (stops, stays) == ([True, False, False], [True, True, False])


def test_a_car_that_does_what_the_teacher_says_stands_in_the_bay(tmp_path: Path) -> None:
    batch = aisle(tmp_path)
    teacher, begun = GreedyTeacher(batch), np.ones((2, 1), np.bool_)
    for _ in range(600):
        batch.step(teacher.labels(batch.observations, begun))
        if batch.terminated.all():
            break
    assert [batch.episode_of(w, 0)["ending"] for w in range(2)] == ["parked"] * 2


def test_slots_side_by_side_and_one_behind_another_have_costs_together() -> None:
    assert alike("aisle-90", CAR) == [list(range(16)), list(range(16, 32))]
    assert alike("generated:street:7", CAR) == [[0, 1, 2, 3, 4]]


def test_for_a_trailer_slots_are_alike_around_which_all_is_alike() -> None:
    lorry = vehicle_named("lorry-16m5")
    # From each dock it is as far to no other wall; turned round, the lot of four rows is the same.
    assert len(alike("dock-35", lorry)) == 18
    assert [len(slots) for slots in alike("grid-150", lorry)] == [2] * 54
    assert [0, 107] in alike("grid-150", lorry)


def alike(lot: str, vehicle: Vehicle) -> list[list[int]]:
    world = make_world(parking_scenario(lot), [1])
    return alike_slots(world.parking.lots, world.walls, 0, vehicle)


def test_it_refuses_what_it_cannot_answer_with(tmp_path: Path) -> None:
    with pytest.raises(ScenarioError, match=r"action = .park.: .*choose .dock. or .crawl."):
        GreedyTeacher(aisle(tmp_path, action="park"))


def test_it_refuses_a_lot_whose_obstacles_are_drawn() -> None:
    settings = read_settings("park", ['parking.lots=["yard-70"]', "vehicle=kart-13", "worlds=2"])
    with pytest.raises(ScenarioError, match=r"lot 'yard-70' has no slots: a teacher"):
        School(settings, lambda _: None)
