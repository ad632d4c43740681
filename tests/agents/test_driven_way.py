"""The way that a car has driven, and what it says about where the way goes on."""

import math

import numpy as np
import pytest

from race_agents.planning.driven_way import (
    COUNT,
    NONE,
    POINTS,
    rays_across,
    remember_way,
    wall_off,
)
from race_agents.planning.scan import move_scan
from race_server.core.driver import Briefing
from race_server.core.kernel_driver import DRIVEN_POINTS, KEPT, Cockpit, cockpit_for
from race_server.core.observation import PART_NUMBERS, layout_of
from race_server.core.vehicle_presets import TT02

FIELD, REACH, RAYS = math.radians(200.0), 8.0, 201
LENGTH = TT02.length
STEP_S = 0.05
LEFT = 190  # the ray at 90° to the left


def car_that_drives(speed: float, yaw: float, seconds: float) -> Cockpit:
    """Return a cockpit of a car that has driven at a speed [m/s] and a yaw rate [rad/s]."""
    briefing = Briefing(0, TT02, 3, "lidar", STEP_S, (), FIELD, REACH)
    cockpit = cockpit_for(briefing, layout_of("lidar", RAYS))
    drive(cockpit, speed, yaw, seconds)
    return cockpit


def drive(cockpit: Cockpit, speed: float, yaw: float, seconds: float) -> None:
    see(cockpit, "speed", speed)
    see(cockpit, "yaw_rate", yaw)
    for _ in range(round(seconds / STEP_S)):
        remember_way(cockpit)


def turn_half(cockpit: Cockpit) -> None:
    """Drive half a circle of 1 m radius to the left in 1.5 s."""
    drive(cockpit, math.pi / 1.5, math.pi / 1.5, 1.5)


def see(cockpit: Cockpit, part: str, value: float) -> None:
    cockpit.observation[cockpit.offsets[PART_NUMBERS[part]]] = value


def look(cockpit: Cockpit, free: float) -> tuple[int, int]:
    """Let the car see walls this far away [m]; return the rays that look across its way."""
    for ray in range(RAYS):
        cockpit.memory[KEPT + ray] = free
    move_scan(cockpit.memory, RAYS, FIELD, 0.0, 0.0, 0.0)
    return rays_across(cockpit.memory, RAYS, FIELD, LENGTH)


def places(cockpit: Cockpit) -> np.ndarray:
    """Return the points of the way, shape (N, 2), the last one first [m]."""
    count = int(cockpit.memory[COUNT])
    return np.array(cockpit.memory[POINTS : POINTS + 2 * count]).reshape(count, 2)


def test_the_way_of_a_car_that_drives_straight_on_lies_behind_it() -> None:
    cockpit = car_that_drives(2.0, 0.0, 1.5)  # 3 m, a point after each body length at least
    way = places(cockpit)
    assert way[-1] == pytest.approx([-2.9, 0.0])  # the first decision is where it begins
    assert np.all(np.diff(way[:, 0]) <= -LENGTH)
    assert look(cockpit, REACH) == (NONE, NONE)


def test_only_the_last_points_are_kept() -> None:
    assert len(places(car_that_drives(4.0, 0.0, 10.0))) == DRIVEN_POINTS


def test_after_half_a_circle_the_way_lies_to_the_side_that_the_car_turned_to() -> None:
    # A straight of 4 m, then half a circle of 1 m radius to the left.
    cockpit = car_that_drives(2.0, 0.0, 2.0)
    turn_half(cockpit)
    assert places(cockpit)[-1][0] > 0.0  # where it came from lies ahead
    assert places(cockpit)[-1][1] == pytest.approx(2.0, abs=0.05)
    first, last = look(cockpit, REACH)
    assert LEFT in range(first, last + 1)
    assert first > 100  # no ray ahead or to the right looks across it


def test_a_wall_hides_the_way_behind_it() -> None:
    cockpit = car_that_drives(2.0, 0.0, 2.0)
    turn_half(cockpit)
    assert look(cockpit, 0.4) == (NONE, NONE)


def test_the_way_driven_counts_as_a_wall() -> None:
    cockpit = car_that_drives(2.0, 0.0, 2.0)
    turn_half(cockpit)
    look(cockpit, REACH)
    wall_off(cockpit.memory, RAYS, FIELD, LENGTH)
    assert cockpit.memory[KEPT + 3 * RAYS + LEFT] == pytest.approx(2.0, abs=0.1)  # y of its point
    assert cockpit.memory[KEPT + 100] == REACH


def test_a_car_that_backs_out_forgets_where_it_had_been() -> None:
    cockpit = car_that_drives(2.0, 0.0, 2.0)
    before = len(places(cockpit))
    drive(cockpit, -1.0, 0.0, 1.0)
    assert len(places(cockpit)) < before
    assert places(cockpit)[0][0] <= 0.0
    assert look(cockpit, REACH) == (NONE, NONE)


@pytest.mark.parametrize("part", ["lights", "rescue_offered"])
def test_a_car_that_may_be_put_elsewhere_begins_a_new_way(part: str) -> None:
    cockpit = car_that_drives(2.0, 0.0, 2.0)
    see(cockpit, part, 1.0)
    remember_way(cockpit)
    assert len(places(cockpit)) == 0
