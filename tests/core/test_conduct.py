"""Which kart is blocked, which is at fault: rules in plain numbers, then in a world."""

import math
from dataclasses import replace

import numpy as np
import pytest

from race_server.core.messages import EventKind, Retirement, Status
from race_server.core.rules.conduct import is_in_the_way, is_ramming
from race_server.core.state import World
from race_server.core.step import advance
from race_server.core.vehicle_presets import TT02
from race_server.scenario.race import Rules, Scenario, make_world
from support.courses import SMALL_RING

RULES = Rules(
    countdown_s=0.0,
    laps=3,
    items=False,
    stuck_s=0.0,
    stopped_limit_s=2.0,
    wrong_way_removal=2.0,
    ram_speed=1.0,
    ram_warnings=2,
)
STAND = (0.0, 0.0, 1.0, 0.0)


def is_blocked_by(along: float, across: float, turn: float = 0.0) -> bool:
    return is_in_the_way(along, across, turn, 0.4, 0.2, 0.4, 0.2)


def test_a_kart_whose_tail_is_less_than_a_length_ahead_is_in_the_way() -> None:
    assert is_blocked_by(0.75, 0.0)  # 0.35 m between nose and tail


def test_a_kart_further_ahead_is_not() -> None:
    assert not is_blocked_by(0.85, 0.0)


def test_a_kart_behind_is_not_in_the_way() -> None:
    assert not is_blocked_by(-0.5, 0.0)


def test_a_kart_beside_the_own_lane_is_not_in_the_way_unless_it_stands_across() -> None:
    assert not is_blocked_by(0.5, 0.25)
    assert is_blocked_by(0.5, 0.25, turn=0.5 * math.pi)


def test_a_hard_blow_from_behind_is_ramming() -> None:
    assert is_ramming(facing=1.0, nose=-0.2, closing=1.5, approach=3.0, ram_speed=1.0)


@pytest.mark.parametrize(
    "but",
    [
        {"closing": 0.9},  # a soft touch
        {"facing": 0.5},  # flank to flank
        {"nose": 0.1},  # against the front half: an argument over a bend
        {"approach": 0.2},  # reversed into
        {"ram_speed": 0.0},  # not judged
    ],
)
def test_anything_less_is_racing(but: dict[str, float]) -> None:
    blow = {"facing": 1.0, "nose": -0.2, "closing": 1.5, "approach": 3.0, "ram_speed": 1.0}
    assert not is_ramming(**{**blow, **but})


def world_of(*places: tuple[float, float], rules: Rules = RULES) -> World:
    """Return a world with a kart at each place: degrees on the ring, turned by radians."""
    world = make_world(Scenario(SMALL_RING, karts=len(places), rules=rules))
    for body, (degrees, turn) in zip(world.bodies[0], places, strict=True):
        angle = math.radians(degrees)
        body.x, body.y = 6.0 * math.cos(angle), 6.0 * math.sin(angle)
        body.heading = angle + 0.5 * math.pi + turn
    return world


def drive(world: World, seconds: float, *controls: tuple[float, float, float, float]) -> list[int]:
    """Let time pass and return the kinds of all events."""
    kinds = []
    for _ in range(round(seconds * 20)):
        advance(world, np.array([controls]), 3)
        kinds += [int(row.kind) for row in world.events[0][: world.event_counts[0]]]
        world.event_counts[0] = 0
    return kinds


def test_a_kart_that_stands_is_removed_after_the_limit() -> None:
    world = world_of((20.0, 0.0))
    drive(world, 1.9, STAND)
    assert world.bodies["status"][0, 0] == Status.RACING
    drive(world, 0.2, STAND)
    assert world.racers["retired_for"][0, 0] == Retirement.STOPPED


def test_a_kart_that_is_blocked_is_removed_only_when_the_way_is_free() -> None:
    world = world_of((20.0, 0.0), (25.0, 0.0))  # half a metre apart, 0.07 m between them
    drive(world, 2.1, STAND, STAND)
    assert list(world.bodies["status"][0]) == [Status.RACING, Status.RETIRED]
    drive(world, 2.1, STAND, STAND)
    assert world.racers["retired_for"][0, 0] == Retirement.STOPPED


def test_of_two_karts_nose_to_nose_the_one_that_faces_the_wrong_way_is_removed() -> None:
    world = world_of((20.0, 0.0), (25.0, math.pi))
    drive(world, 2.1, STAND, STAND)
    assert list(world.bodies["status"][0]) == [Status.RACING, Status.RETIRED]


def test_two_metres_the_wrong_way_and_a_kart_is_out() -> None:
    world = world_of((20.0, 0.0))
    reverse = (0.14, -1.0, 0.0, 0.0)
    drive(world, 1.5, reverse)
    assert world.bodies["status"][0, 0] == Status.RACING
    drive(world, 2.0, reverse)
    assert world.racers["retired_for"][0, 0] == Retirement.WRONG_WAY


def test_without_the_limit_it_is_only_told_so() -> None:
    world = world_of((20.0, 0.0), rules=replace(RULES, wrong_way_removal=0.0))
    assert EventKind.WRONG_WAY in drive(world, 3.5, (0.14, -1.0, 0.0, 0.0))
    assert world.bodies["status"][0, 0] == Status.RACING


def bump(world: World, *, speed: float, control: tuple[float, float, float, float]) -> list[int]:
    """Let kart 0 set out at a speed while kart 1 stands; events are told from half a second on."""
    drive(world, 0.6, STAND, STAND)
    world.bodies[0, 0].speed = speed
    return drive(world, 0.8, control, STAND)


def test_who_drives_into_a_standing_kart_is_warned() -> None:
    world = world_of((0.0, 0.0), (15.0, 0.0))
    assert EventKind.WARNING in bump(world, speed=3.0, control=(0.14, 0.3, 0.0, 0.0))
    assert list(world.racers["warnings"][0]) == [1, 0]
    assert world.bodies["status"][0, 0] == Status.RACING


def test_the_last_warning_is_the_end_of_the_race() -> None:
    world = world_of((0.0, 0.0), (15.0, 0.0), rules=replace(RULES, ram_warnings=1))
    bump(world, speed=3.0, control=(0.14, 0.3, 0.0, 0.0))
    assert world.racers["retired_for"][0, 0] == Retirement.RAMMING
    assert world.bodies["status"][0, 1] == Status.RACING


def test_a_kart_that_is_reversed_into_is_not_at_fault() -> None:
    quick = replace(TT02, reverse_speed=3.0)
    rules = replace(RULES, ram_speed=0.5)
    world = make_world(Scenario(SMALL_RING, karts=2, rules=rules, vehicles=(quick,)))
    kinds = bump(world, speed=-2.0, control=(0.14, -1.0, 0.0, 0.0))  # kart 1 is behind
    assert EventKind.CONTACT_KART in kinds
    assert EventKind.WARNING not in kinds
