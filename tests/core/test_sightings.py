"""What a vehicle remembers of people and vehicles that its rays have met."""

import numpy as np
import pytest

from race_server.core.observation import Observation, layout_of, offsets_of
from race_server.core.stages.observe import observe_karts
from race_server.core.state import World
from race_server.envs.presets import scenario_on
from race_server.scenario.race import make_world
from support.lots import AHEAD, one_slot, open_lot, park_world, put, wait

MOVERS = (
    *("movers_x", "movers_y", "movers_speed_x", "movers_speed_y"),
    *("movers_age", "movers_radius"),
)
NONE = [100.0, 0.0, 0.0, 0.0, 5.0, 0.0]
STEP = 0.15  # [m] that a person of 1.5 m/s walks between two scans


def world_with_a_person() -> World:
    """Return a kart whose centre of gravity is at the origin and points east, and a person."""
    world = park_world(one_slot(people=1))
    put(world, AHEAD, 0.0)
    return world


def step_to(world: World, x: float, y: float) -> None:
    """Put the person at (x, y), who rests there, and let 0.1 s pass: until the next scan."""
    walker = world.parking.walkers[0, 0]
    walker.x, walker.y, walker.to_x, walker.to_y = x, y, x + 5.0, y
    walker.rest_at, walker.rest_ticks = 100.0, 10_000
    wait(world, 6)


def seen(world: World, place: int = 0, kart: int = 0) -> list[float]:
    """Return what is shown of the mover at a place, nearest first."""
    layout = layout_of(MOVERS, 201)
    values = np.zeros((1, world.bodies.shape[1], layout.size), np.float32)
    presets = np.where(np.arange(world.bodies.shape[1]) == kart, 0, -1)
    observe_karts(world, offsets_of(layout)[None], presets, values)
    shown = Observation(0, layout, values[0, kart])
    return [float(shown[name][place]) for name in MOVERS]


def test_a_person_ahead_is_seen_with_the_speed_from_one_sighting_to_the_next() -> None:
    world = world_with_a_person()
    step_to(world, 5.0, 0.0)
    assert seen(world) == pytest.approx([5.0, 0.0, 0.0, 0.0, 0.0, 0.3])
    step_to(world, 5.0, STEP)
    assert seen(world) == pytest.approx([5.0, STEP, 0.0, 1.5, 0.0, 0.3], abs=1e-5)
    assert seen(world, place=1) == NONE


def test_who_is_not_met_any_more_would_walk_on_and_is_forgotten_after_5_s() -> None:
    world = world_with_a_person()
    step_to(world, 5.0, 0.0)
    step_to(world, 5.0, STEP)
    step_to(world, -30.0, 0.0)  # behind the kart, where no ray goes
    wait(world, 54)
    assert seen(world) == pytest.approx([5.0, STEP + 1.5, 0.0, 1.5, 1.0, 0.3], abs=1e-5)
    wait(world, 240)
    assert seen(world) == pytest.approx([5.0, STEP + 7.5, 0.0, 1.5, 5.0, 0.3], abs=1e-5)
    wait(world, 6)
    assert seen(world) == NONE


def test_a_person_is_seen_in_the_frame_of_the_kart_as_it_stands_now() -> None:
    world = world_with_a_person()
    step_to(world, 5.0, 0.0)
    step_to(world, 5.0, STEP)
    world.bodies[0, 0].heading = 0.5 * np.pi
    # Where it was straight ahead is now to the right; it walked north, which is now ahead.
    assert seen(world) == pytest.approx([STEP, -5.0, 1.5, 0.0, 0.0, 0.3], abs=1e-5)


def test_a_person_behind_a_kart_is_not_seen() -> None:
    world = park_world(open_lot(people=1), vehicles=2)
    put(world, AHEAD, 0.0, kart=0)
    put(world, 4.0, 0.0, 0.5 * np.pi, kart=1)
    step_to(world, 7.0, 0.0)
    # The kart's middle is 4 m ahead and it is met; the person behind it is not.
    assert seen(world)[:2] == pytest.approx([4.0, 0.0], abs=1e-5)
    assert seen(world)[5] == pytest.approx(0.65)
    assert seen(world, place=1) == NONE


def test_the_nearer_of_two_comes_first() -> None:
    world = park_world(open_lot(people=1), vehicles=2)
    put(world, AHEAD, 0.0, kart=0)
    put(world, 6.0, 3.0, kart=1)
    step_to(world, 4.0, -1.0)
    assert [seen(world, place)[5] for place in (0, 1)] == pytest.approx([0.3, 0.65])
    step_to(world, 6.5, -3.5)
    assert [seen(world, place)[5] for place in (0, 1)] == pytest.approx([0.65, 0.3])


def test_a_race_keeps_no_sightings_and_a_lot_one_for_each_that_moves() -> None:
    assert park_world(open_lot(people=1), vehicles=2).sight.sightings.shape == (1, 2, 3)
    assert make_world(scenario_on("covapsy-base", karts=2)).sight.sightings.size == 0
