"""How a car notices that it has turned round, and turns back."""

import math

import pytest

from race_agents.planning.scan import move_scan
from race_agents.planning.turn_back import SIDE, TURN, YAW_RATE, has_turned_round, lies_within
from race_server.core.driver import Briefing
from race_server.core.kernel_driver import KEPT, Cockpit, cockpit_for
from race_server.core.observation import PART_NUMBERS, layout_of
from race_server.core.vehicle_presets import TT02

FIELD, REACH, RAYS = math.radians(200.0), 8.0, 201
LEFT = 190  # the ray at 90° to the left


def cockpit_that_sees(ranges: dict[int, float], yaw: float, speed: float = 1.8) -> Cockpit:
    """Return a cockpit of a car that sees these ranges [m] by ray, and nothing else."""
    briefing = Briefing(0, TT02, 3, "lidar", 0.05, (), FIELD, REACH)
    cockpit = cockpit_for(briefing, layout_of("lidar", RAYS))
    for ray in range(RAYS):
        cockpit.memory[KEPT + ray] = ranges.get(ray, REACH)
    move_scan(cockpit.memory, RAYS, FIELD, 0.0, 0.0, 0.0)
    see(cockpit, "speed", speed)
    cockpit.observation[cockpit.offsets[YAW_RATE]] = yaw
    return cockpit


def see(cockpit: Cockpit, part: str, value: float) -> None:
    cockpit.observation[cockpit.offsets[PART_NUMBERS[part]]] = value


def decisions_until(cockpit: Cockpit, turned: bool, most: int = 200) -> int:
    """Return how many decisions it takes until the car is to turn back, or is to no more."""
    return next(n for n in range(1, most) if has_turned_round(cockpit, RAYS) is turned)


def test_a_post_one_metre_to_the_left_lies_within_the_left_circle_of_80_cm_alone() -> None:
    memory = cockpit_that_sees({LEFT: 1.0}, 0.0).memory
    assert lies_within(memory, RAYS, REACH, 1.0, 0.8)
    assert not lies_within(memory, RAYS, REACH, 1.0, 0.4)
    assert not lies_within(memory, RAYS, REACH, -1.0, 0.8)
    assert not lies_within(memory, RAYS, 0.9, 1.0, 0.8)  # beyond the reach is no echo


def test_a_turn_of_120_degrees_round_nothing_leads_back_until_the_car_faces_the_old_way() -> None:
    cockpit = cockpit_that_sees({}, yaw=2.0)  # 0.1 rad a decision
    assert decisions_until(cockpit, turned=True) == 21
    assert cockpit.memory[SIDE] == -1.0
    cockpit.observation[cockpit.offsets[YAW_RATE]] = -2.0
    # From 2.1 rad to less than 50°, which are 0.87 rad.
    assert decisions_until(cockpit, turned=False) == 13
    assert cockpit.memory[TURN] == 0.0


def test_the_same_turn_round_a_post_is_a_bend() -> None:
    cockpit = cockpit_that_sees({LEFT: 0.9}, yaw=2.0)
    assert not any(has_turned_round(cockpit, RAYS) for _ in range(100))


def test_bends_left_and_right_on_an_open_floor_cancel_each_other() -> None:
    cockpit = cockpit_that_sees({}, yaw=2.0)
    for _ in range(10):
        for yaw in (2.0, -2.0):
            cockpit.observation[cockpit.offsets[YAW_RATE]] = yaw
            assert not any(has_turned_round(cockpit, RAYS) for _ in range(15))
    assert cockpit.memory[TURN] == pytest.approx(0.0)


def test_at_the_word_of_race_control_the_car_turns_round_instead_of_standing() -> None:
    cockpit = cockpit_that_sees({}, yaw=0.0)
    see(cockpit, "wrong_way", 1.0)
    assert has_turned_round(cockpit, RAYS)
    assert cockpit.observation[cockpit.offsets[PART_NUMBERS["wrong_way"]]] == 0.0
    cockpit.observation[cockpit.offsets[YAW_RATE]] = 2.0
    assert 20 < decisions_until(cockpit, turned=False) < 25  # 130° at 0.1 rad each


def test_with_a_wall_on_one_side_it_turns_to_the_other() -> None:
    for ray, side in ((LEFT, -1.0), (RAYS - 1 - LEFT, 1.0)):
        cockpit = cockpit_that_sees({ray: 0.5}, yaw=0.0)
        see(cockpit, "wrong_way", 1.0)
        assert has_turned_round(cockpit, RAYS)
        assert cockpit.memory[SIDE] == side


def test_a_car_that_is_offered_a_rescue_forgets_its_turn() -> None:
    cockpit = cockpit_that_sees({}, yaw=2.0)
    decisions_until(cockpit, turned=True)
    see(cockpit, "rescue_offered", 1.0)
    assert not has_turned_round(cockpit, RAYS)
    assert cockpit.memory[TURN] == 0.0
