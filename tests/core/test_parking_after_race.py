"""Karts that have finished a race on a track with slots."""

from dataclasses import replace

import numpy as np
import pytest

from race_server.core import codes
from race_server.core.driven import are_driven
from race_server.core.state import World
from race_server.core.step import advance
from race_server.core.traffic import Traffic
from race_server.core.vehicle_presets import KART_13
from race_server.scenario.race import Rules, Scenario, make_world
from race_server.scenario.track.load import load_course
from race_server.scenario.track.lot import Lot
from race_server.session.parking import check_slot, free_slot, send_to

SLOTS = np.array([[30.0, 0.0, 0.0, 3.0, 2.0], [34.0, 0.0, 0.0, 3.0, 2.0]])


def race(*, slots: bool = True, karts: int = 2) -> World:
    """Return a race in which kart 0 has finished its lap at 10 s, and stands 10 m before slot 0."""
    course = load_course("hangar-400")
    course = replace(course, lot=Lot(SLOTS) if slots else None)
    rules = Rules(laps=1, countdown_s=0.0, items=False, stuck_s=0.0)
    world = make_world(Scenario(course, karts=karts, vehicles=(KART_13,), rules=rules))
    world.races["tick"][0] = 600
    world.races["winner_tick"][0] = 600
    world.bodies["status"][0, 0], world.racers["finish_us"][0, 0] = codes.FINISHED, 10_000_000
    put(world, 20.0)
    return world


def put(world: World, x: float) -> None:
    """Put the middle of kart 0 at x [m] on the straight, facing east."""
    body = world.bodies[0, 0]
    body.x, body.y, body.heading = x - KART_13.box_offset, 0.0, 0.0


def drive(world: World, seconds: float, throttle: float = 1.0) -> None:
    """Let kart 0 drive straight on; all others stand."""
    controls = np.zeros((1, world.bodies.shape[1], 4))
    controls[0, :, 2] = 1.0
    controls[0, 0, 1:3] = throttle, float(throttle == 0.0)
    advance(world, controls, round(60 * seconds))


def test_without_an_order_a_kart_that_has_finished_stands() -> None:
    world = race()
    drive(world, 1.0)
    assert world.bodies[0, 0].speed == 0.0
    assert not are_driven(world)[0]


def test_with_an_order_it_drives_on_at_the_speed_of_the_pits() -> None:
    world = race()
    send_to(world, 0, 1)
    assert are_driven(world)[0]
    drive(world, 1.0)
    assert 0.5 < world.bodies[0, 0].speed <= 5.0
    assert world.parking.parkers[0, 0].way > 0.3


def test_a_kart_that_still_races_goes_to_no_slot() -> None:
    world = race()
    world.bodies["status"][0, 0] = codes.RACING
    send_to(world, 0, 0)
    put(world, 30.0)
    drive(world, 2.0, throttle=0.0)
    parker = world.parking.parkers[0, 0]
    assert (parker.held_ticks, parker.parked_tick, parker.way) == (0, 0, 0.0)


def test_who_stands_in_its_slot_for_a_second_is_parked_and_keeps_its_time() -> None:
    world = race()
    send_to(world, 0, 0)
    put(world, 30.0)
    drive(world, 1.1, throttle=0.0)
    # The level `parked` asks for a second.
    assert world.parking.parkers[0, 0].parked_tick == pytest.approx(660, abs=2)
    assert world.racers[0, 0].finish_us == 10_000_000
    assert world.bodies[0, 0].status == codes.FINISHED
    assert world.parking.blocks[0, 0].kind == codes.KART_HIT
    assert not are_driven(world)[0]


def test_on_its_way_to_a_slot_it_keeps_the_way_that_it_announced_until_it_is_parked() -> None:
    world, traffic = race(), Traffic(2)
    send_to(world, 0, 0)
    traffic.watch(world, 0)
    assert traffic.announce(0, np.repeat(traffic.boxes[:1], 3, axis=0))
    traffic.watch(world, 0)
    assert traffic.has_way(0)
    world.parking.parkers["parked_tick"][0, 0] = 660
    traffic.watch(world, 0)
    assert not traffic.has_way(0)


def test_the_race_waits_for_a_kart_on_its_way_to_a_slot() -> None:
    world = race(karts=1)
    send_to(world, 0, 0)
    drive(world, 0.5, throttle=0.0)
    assert not world.races[0].over
    put(world, 30.0)
    drive(world, 1.1, throttle=0.0)
    assert world.races[0].over


def test_it_waits_no_longer_than_for_the_finish_of_all() -> None:
    world = race(karts=1)
    send_to(world, 0, 0)
    drive(world, 101.0, throttle=0.0)  # 100 s behind the winner
    assert world.races[0].over


def test_a_kart_without_a_slot_gets_the_first_free_one() -> None:
    world = race()
    send_to(world, 1, 0)
    assert free_slot(world, 0) == 1
    check_slot(world, 0, -1)
    send_to(world, 0, -1)
    assert world.parking.parkers[0, 0].slot == 1
    assert free_slot(world, 1) == 0


def test_a_track_without_slots_has_no_parkers() -> None:
    assert race(slots=False).parking.parkers.shape == (1, 0)
