"""People in a car park: where they walk, and what it means to touch one."""

import numpy as np
import pytest

from race_server.core.messages import EventKind, RayHit, Retirement, Status
from race_server.core.state import World, digest
from support.lots import AHEAD, one_slot, open_lot, park_world, put, roll, wait

NOSE = 1.03  # [m] of a kart, ahead of the middle of its body
RADIUS = 0.3  # [m] of a person


def world_with_a_person(*, bump: bool = False) -> World:
    world = park_world(one_slot(people=1), bump=bump)
    put(world, 0.0, 20.0)
    return world


def stand(world: World, x: float, y: float) -> None:
    """Put the person, who rests there."""
    walker = world.parking.walkers[0, 0]
    walker.x, walker.y, walker.to_x, walker.to_y = x, y, x + 5.0, y
    walker.rest_at, walker.rest_ticks = 100.0, 10_000


def walk(
    world: World, start: tuple[float, float], end: tuple[float, float], *, speed: float
) -> None:
    """Put the person, who walks from a place [m] to another. speed: [m/s]."""
    walker = world.parking.walkers[0, 0]
    walker.x, walker.y = start
    walker.to_x, walker.to_y = end
    walker.speed, walker.rest_ticks = speed, 0


def events(world: World, kind: EventKind) -> list[tuple[int, int, int]]:
    rows = world.events[0][: world.event_counts[0]]
    return [(int(e.kart), int(e.other), int(e.value)) for e in rows if e.kind == kind]


def test_a_kart_that_drives_into_a_person_is_out() -> None:
    world = world_with_a_person()
    stand(world, NOSE + RADIUS + 0.01, 20.0)
    put(world, 0.0, 20.0, speed=1.2)
    roll(world, 3)
    assert world.bodies["status"][0, 0] == Status.RETIRED
    assert world.racers["retired_for"][0, 0] == Retirement.HIT_PERSON
    assert world.parking.parkers["touched"][0, 0] == RayHit.PERSON
    ((kart, person, speed),) = events(world, EventKind.HIT_PERSON)
    assert (kart, person) == (0, 0)
    assert speed == pytest.approx(1200, rel=0.01)


def test_a_person_at_the_corner_is_touched_by_the_disc_and_not_by_a_square() -> None:
    # Beyond the corner of the body, 0.25 m along both axes: 0.354 m are more than 0.3 m.
    world = world_with_a_person()
    stand(world, NOSE + 0.25, 20.0 + 0.65 + 0.25)
    put(world, 0.0, 20.0, speed=0.5)
    roll(world, 1)
    assert world.bodies["status"][0, 0] == Status.RACING
    stand(world, NOSE + 0.2, 20.0 + 0.65 + 0.2)
    put(world, 0.0, 20.0, speed=0.5)
    roll(world, 1)
    assert world.bodies["status"][0, 0] == Status.RETIRED


def test_a_person_who_walks_into_a_standing_kart_is_counted_once_and_not_its_fault() -> None:
    world = world_with_a_person()
    walk(world, (NOSE + 1.0, 20.0), (-10.0, 20.0), speed=1.0)
    wait(world, 60)
    assert world.bodies["status"][0, 0] == Status.RACING
    assert world.parking.parkers["walked_into"][0, 0] == 1
    assert events(world, EventKind.HIT_PERSON) == []


def test_a_person_between_two_standing_karts_counts_once_for_each() -> None:
    # Bumper to bumper with 0.24 m between them, where a person of 0.6 m goes through.
    world = park_world(open_lot(2, people=1), vehicles=2)
    put(world, 0.0, 20.0)
    put(world, 2 * NOSE + 0.24, 20.0, kart=1)
    walk(world, (NOSE + 0.12, 18.0), (NOSE + 0.12, 30.0), speed=1.0)
    wait(world, 240)  # 4 m
    assert world.parking.parkers["walked_into"][0].tolist() == [1, 1]
    assert world.parking.walkers["touching"][0, 0] == 0
    walk(world, (NOSE + 0.12, 18.0), (NOSE + 0.12, 30.0), speed=1.0)
    wait(world, 240)
    assert world.parking.parkers["walked_into"][0].tolist() == [2, 2]


def test_a_kart_that_sets_off_into_a_person_who_leans_on_it_has_hit_them() -> None:
    world = world_with_a_person()
    stand(world, NOSE + RADIUS - 0.01, 20.0)
    put(world, 0.0, 20.0)
    wait(world, 5)
    assert world.parking.parkers["walked_into"][0, 0] == 1
    assert events(world, EventKind.HIT_PERSON) == []
    put(world, 0.0, 20.0, speed=1.2)
    roll(world, 1)
    ((kart, person, speed),) = events(world, EventKind.HIT_PERSON)
    assert (kart, person) == (0, 0)
    assert speed == pytest.approx(1200, rel=0.01)
    assert world.racers["retired_for"][0, 0] == Retirement.HIT_PERSON


def test_where_touches_are_no_crash_a_hit_is_told_once() -> None:
    world = world_with_a_person(bump=True)
    stand(world, NOSE + RADIUS + 0.01, 20.0)
    put(world, 0.0, 20.0, speed=1.2)
    roll(world, 30)
    assert world.bodies["status"][0, 0] == Status.RACING
    assert len(events(world, EventKind.HIT_PERSON)) == 1


def test_the_radar_sees_a_person_as_a_person() -> None:
    world = world_with_a_person()
    stand(world, 7.0 - AHEAD, 20.0)
    wait(world, 6)
    assert world.sight.radar_kinds[0, 0, 4] == RayHit.PERSON
    assert world.sight.radar[0, 0, 4] == pytest.approx(7.0 - RADIUS, abs=1e-3)


def test_a_person_walks_at_its_speed_and_then_elsewhere_in_the_zone() -> None:
    world = world_with_a_person()
    walk(world, (30.0, 30.0), (32.0, 30.0), speed=1.2)
    wait(world, 50)
    walker = world.parking.walkers[0, 0]
    assert walker.x == pytest.approx(31.0)
    wait(world, 60)
    assert walker.leg == 2
    assert 30.0 <= walker.to_x <= 40.0
    assert 30.0 <= walker.to_y <= 40.0
    assert 0.8 <= walker.speed <= 1.6


def test_the_place_of_a_person_is_part_of_the_digest() -> None:
    world = world_with_a_person()
    before = digest(world)
    world.parking.walkers["x"][0, 0] += np.float64(1e-9)
    assert digest(world) != before
