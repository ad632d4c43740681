"""When a vehicle is parked, what is counted on the way, and what others see of it."""

import math

import numpy as np
import pytest

from race_server.core.messages import EventKind, RayHit, Retirement, Status
from race_server.core.rules.parking import ALIGNED_WITHIN
from race_server.core.state import World, digest
from race_server.errors import ScenarioError
from race_server.scenario.level import LEVELS, level_named
from support.lots import one_slot, open_lot, park_world, put, roll, wait

HALF_LENGTH = 1.03  # [m] of a kart


def status(world: World, kart: int = 0) -> Status:
    return Status(int(world.bodies["status"][0, kart]))


def events(world: World) -> list[tuple[EventKind, int, int, int]]:
    rows = world.events[0][: world.event_counts[0]]
    return [(EventKind(e.kind), int(e.kart), int(e.other), int(e.value)) for e in rows]


def after(ticks: int, x: float, y: float, heading: float = 0.0, **how: float | str) -> Status:
    """Return the status of a kart that stood in or near a slot for some ticks."""
    length, level = float(how.pop("length", 3.0)), str(how.pop("level", "parked"))
    world = park_world(one_slot(length=length), level=level)
    put(world, x, y, heading, speed=float(how.pop("speed", 0.0)))
    wait(world, ticks)
    return status(world)


# In the slot


def test_a_kart_in_the_middle_of_its_slot_for_more_than_a_second_is_parked() -> None:
    assert after(60, 0.0, 0.0) is Status.RACING
    assert after(61, 0.0, 0.0) is Status.FINISHED


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_0_30_m_ahead_of_the_middle_are_allowed_and_no_more(side: float) -> None:
    assert after(61, side * 0.29, 0.0) is Status.FINISHED
    assert after(61, side * 0.31, 0.0) is Status.RACING


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_0_15_m_beside_the_middle_are_allowed_and_no_more(side: float) -> None:
    assert after(61, 0.0, side * 0.14) is Status.FINISHED
    assert after(61, 0.0, side * 0.16) is Status.RACING


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_3_degrees_are_allowed_and_no_more(side: float) -> None:
    assert after(61, 0.0, 0.0, side * math.radians(2.9)) is Status.FINISHED
    assert after(61, 0.0, 0.0, side * math.radians(3.1)) is Status.RACING
    assert after(61, 0.0, 0.0, math.pi) is Status.RACING


def test_a_corner_outside_the_slot_is_not_parked_though_the_middle_is_near() -> None:
    # Of 2.20 m a kart of 2.06 m leaves 0.07 m before and behind it.
    assert after(61, 0.06, 0.0, length=2.2) is Status.FINISHED
    assert after(61, 0.08, 0.0, length=2.2) is Status.RACING


def test_a_kart_that_rolls_at_0_06_m_per_s_is_not_parked() -> None:
    world = park_world(one_slot())
    for _ in range(80):
        put(world, 0.0, 0.0, speed=0.06)
        roll(world, 1)
    assert status(world) is Status.RACING


def test_report_a_asks_for_half_a_metre_for_more_than_a_second_at_any_angle_and_speed() -> None:
    assert after(60, 0.3, 0.39, 2.0, level="report-a-2") is Status.RACING
    assert after(61, 0.3, 0.39, 2.0, level="report-a-2") is Status.FINISHED
    assert after(61, 0.3, 0.41, 2.0, level="report-a-2") is Status.RACING
    assert after(1, 0.3, 0.39, -2.0, speed=3.0, level="report-a-1") is Status.FINISHED


def test_a_kart_that_leaves_the_tolerances_begins_its_second_again() -> None:
    world = park_world(one_slot())
    put(world, 0.0, 0.0)
    wait(world, 60)
    put(world, 0.4, 0.0)
    wait(world, 1)
    put(world, 0.0, 0.0)
    wait(world, 60)
    assert status(world) is Status.RACING
    wait(world, 1)
    assert status(world) is Status.FINISHED


def test_a_parked_kart_is_told_with_its_slot_its_angle_and_its_time() -> None:
    world = park_world(one_slot())
    put(world, 0.0, 0.0, 0.040)
    wait(world, 61)
    assert (EventKind.PARKED, 0, 0, 40) in events(world)
    assert world.parking.parkers["parked_tick"][0, 0] == 60
    assert world.racers["finish_us"][0, 0] == 61_000_000 // 60
    assert world.races["over"][0] == 1


def test_the_levels_are_nested() -> None:
    precise, parked = level_named("precise"), level_named("parked")
    assert precise.along < parked.along
    assert precise.across < parked.across
    assert precise.turn < parked.turn < ALIGNED_WITHIN
    with pytest.raises(ScenarioError, match="choose one of report-a-1, report-a-2"):
        level_named("loose")
    for name in LEVELS:
        assert level_named(name) is LEVELS[name]


# On the way


def test_forward_back_and_forward_are_two_changes_of_direction() -> None:
    world = park_world(one_slot())
    for speed in (1.0, -1.0, -1.0, 1.0):
        put(world, -10.0, 0.0, speed=speed)
        roll(world, 6)
    parker = world.parking.parkers[0, 0]
    assert parker.moves == 2
    # 24 ticks at 1 m/s, half of them backwards; rolling takes 0.15 m/s off in a second.
    assert parker.way == pytest.approx(24 / 60, rel=0.02)
    assert parker.reversed == pytest.approx(12 / 60, rel=0.02)


def test_standing_between_two_moves_forward_is_no_change_of_direction() -> None:
    world = park_world(one_slot())
    for speed in (1.0, 0.0, 1.0):
        put(world, -10.0, 0.0, speed=speed)
        wait(world, 1)
    assert world.parking.parkers["moves"][0, 0] == 0


def test_30_m_from_the_slot_report_a_ends_the_round() -> None:
    world = park_world(one_slot(), level="report-a-1")
    put(world, -29.9, 0.0)
    wait(world, 1)
    assert status(world) is Status.RACING
    put(world, -30.1, 0.0)
    wait(world, 1)
    assert status(world) is Status.RETIRED
    assert world.racers["retired_for"][0, 0] == Retirement.LEFT_LOT


def test_after_its_time_a_round_is_over() -> None:
    world = park_world(one_slot(), limit_s=2.0)
    wait(world, 119)
    assert status(world) is Status.RACING
    wait(world, 1)
    assert world.racers["retired_for"][0, 0] == Retirement.TIME_OUT


# What stands


def parked_pair(bump: bool = False) -> World:
    """Return a world in which kart 0 is parked and kart 1 stands 10 m behind it."""
    world = park_world(open_lot(), vehicles=2, bump=bump)
    parker = world.parking.parkers[0, 0]
    x, y = float(parker.x), float(parker.y)
    put(world, x, y, kart=0)
    put(world, x - 10.0, y, kart=1)
    wait(world, 61)
    assert [status(world, kart) for kart in (0, 1)] == [Status.FINISHED, Status.RACING]
    return world


def test_a_parked_kart_is_seen_as_a_kart_by_others_and_not_by_itself() -> None:
    world = parked_pair()
    wait(world, 6)
    ahead = 4  # of nine rays
    assert world.sight.radar_kinds[0, 1, ahead] == RayHit.KART
    # The radar is at the centre of gravity, 0.087 m behind the middle of the body.
    assert world.sight.radar[0, 1, ahead] == pytest.approx(10.0 - HALF_LENGTH + 0.087, abs=1e-3)
    assert set(world.sight.radar_kinds[0, 0]) == {RayHit.BORDER}


def test_a_kart_that_drives_into_a_parked_one_has_crashed_into_a_kart() -> None:
    world = parked_pair()
    parker = world.parking.parkers[0, 0]
    put(world, float(parker.x) - 2 * HALF_LENGTH - 0.05, float(parker.y), speed=2.0, kart=1)
    roll(world, 3)
    assert world.racers["retired_for"][0, 1] == Retirement.CRASH
    assert world.parking.parkers["touched"][0, 1] == RayHit.KART


def test_a_parked_kart_does_not_give_way() -> None:
    world = parked_pair(bump=True)
    before = world.bodies[0, 0].copy()
    parker = world.parking.parkers[0, 0]
    put(world, float(parker.x) - 2 * HALF_LENGTH - 0.05, float(parker.y), speed=3.0, kart=1)
    roll(world, 30)
    assert (world.bodies[0, 0].x, world.bodies[0, 0].y) == (before.x, before.y)
    assert world.bodies["x"][0, 1] < parker.x - 2 * HALF_LENGTH


def test_the_border_is_met_as_a_border() -> None:
    world = park_world(one_slot())
    put(world, 48.95, 0.0, speed=3.0)
    roll(world, 3)
    assert world.parking.parkers["touched"][0, 0] == RayHit.BORDER
    assert world.racers["retired_for"][0, 0] == Retirement.CRASH


def test_more_vehicles_than_slots_are_refused() -> None:
    with pytest.raises(ScenarioError, match="3 vehicles on open: it has 2 slots; two vehicles can"):
        park_world(open_lot(2), vehicles=3)


def test_the_way_driven_is_part_of_the_digest() -> None:
    world = park_world(one_slot())
    before = digest(world)
    world.parking.parkers["way"][0, 0] += np.float64(1e-9)
    assert digest(world) != before
