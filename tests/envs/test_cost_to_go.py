"""Costs to go to the bays of a dock: what walls, neighbours and changes of direction cost."""

import math
from functools import cache

import numpy as np
import pytest

from race_server.core.free_space.rig import rig_of
from race_server.core.kernels.distance_field import Grid
from race_server.core.kernels.geometry import Pose
from race_server.core.state import World
from race_server.core.vehicle_presets import vehicle_named
from race_server.envs.parking.heuristics.atlas import Atlas, cost_from, make_atlas, standing_in
from race_server.envs.parking.heuristics.table import HEURISTICS
from race_server.errors import ScenarioError
from race_server.scenario.parking import parking_scenario
from race_server.scenario.race import make_world

LORRY = vehicle_named("lorry-16m5")
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


def test_it_is_one_of_the_heuristics_for_vehicles_with_a_trailer() -> None:
    assert HEURISTICS["cost-to-go"].has_trailer
