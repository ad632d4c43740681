"""Costs to go to the bays of a dock: what walls, neighbours and changes of direction cost."""

import math
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from race_server.core.free_space.rig import rig_of, rig_of_car
from race_server.core.kernels.distance_field import Grid
from race_server.core.kernels.geometry import Pose
from race_server.core.state import World
from race_server.core.vehicle_presets import vehicle_named
from race_server.envs.batch import Batch
from race_server.envs.parking.heuristics.atlas import Atlas, cost_from, make_atlas, standing_in
from race_server.envs.parking.heuristics.table import HEURISTICS, check_vehicle
from race_server.envs.presets import parking_task
from race_server.errors import ScenarioError
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import make_world

LORRY, CAR = vehicle_named("lorry-16m5"), vehicle_named("car")
BAY = 8  # one of 18, in the middle
AT_BAY = Pose(0.0, 0.0, 0.0)


@cache
def dock() -> World:
    return make_world(parking_scenario("dock-35"), [1])


@cache
def atlas() -> Atlas:
    world = dock()
    return make_atlas(world.parking.lots, world.walls, LORRY, ["dock-35"])


def cost(out: float, aside: float, turned: float = 0.0) -> float:
    """Return the cost [m] from a place of the trailer's axle before a bay, `out` and `aside` [m].

    turned: by which the trailer is turned from the bay's heading [degrees].
    """
    x0, y0, cell, columns, rows = atlas().frames[BAY].tolist()
    frame = Grid(x0, y0, cell, int(columns), int(rows))
    return cost_from(atlas().costs[BAY], frame, AT_BAY, Pose(out, aside, math.radians(turned)))


def test_there_are_costs_to_every_bay() -> None:
    assert len(atlas().costs) == len(atlas().frames) == 18
    assert np.isfinite(atlas().costs).all()


def test_straight_before_the_bay_the_cost_is_the_distance() -> None:
    assert cost(0.0, 0.0) == pytest.approx(0.0, abs=0.5)
    assert cost(8.0, 0.0) == pytest.approx(8.0, abs=1.5)
    assert cost(14.0, 0.0) == pytest.approx(14.0, abs=1.5)


def test_beside_its_bay_a_trailer_has_to_come_out_and_back() -> None:
    # 8 m out, 6 m for a change of direction, 8 m back, and as much again ahead as it is aside.
    assert cost(8.0, 4.0) > 8.0 + 6.0 + 8.0


def test_a_trailer_that_is_turned_round_costs_a_turn_of_the_whole_lorry() -> None:
    # Half a circle of the least radius, and two changes of direction.
    radius = rig_of(LORRY, 0.0, 1.0).drawn.radius
    assert cost(14.0, 0.0, 180.0) > 14.0 + math.pi * radius + 2.0 * 6.0 - 3.0


def test_left_and_right_cost_nearly_the_same_in_the_middle_of_the_dock() -> None:
    for out, aside, turned in ((12.0, 5.0, 20.0), (16.0, 8.0, 45.0), (14.0, 10.0, 90.0)):
        mirrored = cost(out, -aside, -turned)
        assert cost(out, aside, turned) == pytest.approx(mirrored, abs=6.0)


def test_all_bays_but_its_own_count_as_occupied() -> None:
    lots = dock().parking.lots
    boxes = standing_in(lots, lots.lots[0], BAY)
    assert boxes.shape == (17, 6)
    assert np.abs(boxes[:, 0] - lots.slots[BAY]["x"]).min() == pytest.approx(4.0)
    assert boxes[:, 4:] == pytest.approx(np.tile([6.8, 1.275], (17, 1)))


def test_a_lot_without_slots_is_refused_in_a_sentence() -> None:
    world = make_world(parking_scenario("yard-70"), [1])
    with pytest.raises(ScenarioError, match=r"lot 'yard-70' has no slots: .*choose another"):
        make_atlas(world.parking.lots, world.walls, LORRY, ["yard-70"])


def test_a_car_is_its_rear_axle_drawn_by_its_front_wheels() -> None:
    rig = rig_of_car(CAR, 0.0, 1.0)
    curvature = math.sin(rig.sharpest) / (rig.bar * math.cos(rig.sharpest) + rig.hitch)
    assert 1.0 / curvature == pytest.approx(CAR.turning_radius)


# One bay that is reversed into: 5.0 m long, its heading leads out to an aisle of 6 m.
BAY_OF_A_CAR = """
area = [0, 20, 0, 11]
vehicle = "car"
[[rows]]
at = [10, 2.5]
heading = 90
[[zones]]
role = "start"
x = [3, 5]
y = [8, 8]
[taken]
share = 1.0
"""


def test_a_car_reverses_into_its_bay_and_costs_a_way_out_where_it_stands_beside_it(
    tmp_path: Path,
) -> None:
    file = tmp_path / "bay.toml"
    file.write_text(BAY_OF_A_CAR)
    world = make_world(parking_scenario(str(file)), [1])
    made = make_atlas(world.parking.lots, world.walls, CAR, ["bay"])
    x0, y0, cell, columns, rows = made.frames[0].tolist()
    frame = Grid(x0, y0, cell, int(columns), int(rows))

    def cost_of(out: float, aside: float, degrees: float) -> float:
        pose = Pose(out, aside, math.radians(degrees))
        return cost_from(made.costs[0], frame, AT_BAY, pose)

    assert cost_of(0.0, 0.0, 0.0) == pytest.approx(0.0, abs=0.4)
    assert cost_of(3.0, 0.0, 0.0) == pytest.approx(3.0, abs=0.7)
    # Along the aisle, past the bay: a quarter of a circle back and the rest straight.
    past = 0.5 * math.pi * CAR.turning_radius + 4.0 - CAR.turning_radius
    assert cost_of(4.0, -3.2, -90.0) == pytest.approx(past, abs=2.0)
    # As far before the bay it has to drive past it first.
    assert cost_of(4.0, 3.2, -90.0) > past + 4.0


def test_it_is_for_vehicles_with_one_trailer_or_none() -> None:
    heuristic = HEURISTICS["cost-to-go"]
    for vehicle in (CAR, LORRY):
        check_vehicle(heuristic, vehicle)
    with pytest.raises(ScenarioError, match=r"with one trailer or none, and 'lorry-16m5' draws 2;"):
        check_vehicle(heuristic, replace(LORRY, trailers=2 * LORRY.trailers))


def test_one_lot_may_be_given_several_times_and_two_vehicles_have_no_common_costs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(f"{make_atlas.__module__}.cache_root", lambda: tmp_path)
    file = tmp_path / "bay.toml"
    file.write_text(BAY_OF_A_CAR)
    task = parking_task(str(file), vehicle="car").with_options(heuristic="cost-to-go")
    twice = replace(task, scenarios=2 * task.scenarios)
    assert len(Batch(twice, worlds=2).observations) == 2
    kart = parking_task(str(file), vehicle="kart-13").scenarios
    with pytest.raises(ScenarioError, match=r"is for one vehicle: car and kart-13 learn here"):
        Batch(replace(task, scenarios=task.scenarios + kart))
