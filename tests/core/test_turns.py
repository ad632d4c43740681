"""A race depends on who starts where, and not on the numbers of its karts."""

from dataclasses import replace

import numpy as np

from race_server.core.messages import EventKind, Fault, Retirement
from race_server.core.state import World
from race_server.core.step import advance, remove
from race_server.scenario.race import ABSENT, Rules, Scenario, make_world
from support.courses import SMALL_RING

RACE = Scenario(SMALL_RING, karts=4, rules=Rules(countdown_s=0.0, laps=9, items=False), seed=7)


def driven(world: World, places: list[int]) -> World:
    """Drive 10 s in a heap: those behind are faster. places: the kart at each place."""
    controls = np.zeros((*world.bodies.shape, 4))
    controls[0, places, 1] = (0.02, 0.8, 0.9, 1.0)
    for _ in range(200):
        racers = world.racers[0]
        aside = 0.044 - 0.5 * racers["lateral_offset"] - racers["heading_error"]
        controls[0, :, 0] = np.clip(aside / 0.314, -1.0, 1.0)
        advance(world, controls, 3)
    return world


def test_karts_that_change_numbers_drive_the_same_race_to_the_last_bit() -> None:
    one = driven(make_world(RACE), [0, 1, 2, 3])
    # Seat 0 is free here, and places 0 to 3 are those of karts 3, 1, 4 and 2.
    order = (ABSENT, 1, 3, 0, 2)
    other = driven(make_world(replace(RACE, karts=5, grid_order=order)), [3, 1, 4, 2])
    assert one.racers["contacts"][0].sum() >= 6
    for name in ("x", "y", "heading", "speed", "yaw_rate"):
        np.testing.assert_array_equal(one.bodies[name][0], other.bodies[name][0, [3, 1, 4, 2]])
    for name in ("distance", "contacts", "warnings", "rank", "grid_place"):
        np.testing.assert_array_equal(one.racers[name][0], other.racers[name][0, [3, 1, 4, 2]])
    np.testing.assert_array_equal(one.sight.lidar[0], other.sight.lidar[0, [3, 1, 4, 2]])


def test_karts_on_the_places_of_their_numbers_have_the_turns_of_their_numbers() -> None:
    world = make_world(replace(RACE, karts=5, fitted=(7, ABSENT, 7, 7, ABSENT)))
    assert world.turns.tolist() == [[0, 1, 2, 3, 4]]


def test_a_kart_that_stewards_remove_is_out_and_the_event_says_why() -> None:
    world = make_world(RACE)
    advance(world, np.zeros((1, 4, 4)), 3)
    world.event_counts[:] = 0
    remove(world, 0, 2, Fault.DANGEROUS)
    remove(world, 0, 2, Fault.RAMMING)  # it is out already
    (event,) = world.events[0, : world.event_counts[0]]
    assert (event.kind, event.kart) == (EventKind.RETIRED, 2)
    assert (event.other, event.value) == (Retirement.REMOVED, Fault.DANGEROUS)
