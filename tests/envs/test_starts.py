"""Where karts start, in which order, and in which of several scenarios."""

from dataclasses import replace

import numpy as np
import pytest

from race_server.core import codes
from race_server.envs.batch import Batch
from race_server.envs.buffers import REENTER, STAY
from race_server.envs.presets import parking_task, race_task, task_on, time_trial_task
from race_server.envs.single import OneKart
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.race import Scenario
from race_server.scenario.track.reverse import reversed_course
from support.courses import SMALL_RING
from support.tasks import FREE, ring_task


def test_random_starts_are_on_the_track_and_apart() -> None:
    batch = Batch(ring_task(6, random_start=True), worlds=20)
    assert (np.abs(batch.world.racers["lateral_offset"]) < 0.6).all()
    for bodies in batch.world.bodies:
        places = np.stack([bodies["x"], bodies["y"]], axis=1)
        gaps = np.hypot(*(places[:, None] - places[None]).transpose(2, 0, 1))
        assert gaps[~np.eye(6, dtype=bool)].min() > 0.45


def test_random_starts_on_a_shipped_track_face_the_direction_of_travel() -> None:
    batch = Batch(race_task(random_start=True), worlds=20)
    assert (np.abs(batch.world.racers["heading_error"]) < 0.6).all()


@pytest.mark.parametrize("after", [STAY, REENTER])
def test_who_starts_at_a_random_place_has_missed_no_gate(after: int) -> None:
    task = ring_task(4, random_start=True, learners=1, opponents=("pure_pursuit",))
    batch = Batch(task, worlds=4, after=after)
    if after == REENTER:
        batch.world.bodies["status"][:, 1:] = codes.RETIRED
    for _ in range(300):
        batch.step(np.zeros((4, 1, 3)))
    # In every world one has come to the line, if not all: the learning kart stands in the way.
    assert batch.world.racers["started"][:, 1:].any(axis=1).all()
    assert not batch.world.racers["penalties"].any()


def test_who_started_at_a_random_place_misses_gates_behind_its_first_line() -> None:
    batch = Batch(ring_task(1, random_start=True))
    racer, gates = batch.world.racers[0, 0], SMALL_RING.gates
    racer.next_gate, racer.started, racer.cutting, racer.zone = 1, 1, 0, 3
    racer.progress = float(gates[4]) - 0.01
    angle = float(gates[4]) / 6.0
    body = batch.world.bodies[0, 0]
    body.x, body.y, body.heading = 6 * np.cos(angle), 6 * np.sin(angle), angle + np.pi / 2
    batch.step([[[0.0, 0.0, 0.0]]])
    assert batch.world.racers["penalties"][0, 0] == 1


@pytest.mark.parametrize(
    "task",
    [
        time_trial_task("covapsy-train-2023", observation=("heading", "speed")),
        parking_task("dock-35", observation="lot_trailer"),
        parking_task("yard-70", observation=("heading", "slot_heading")),
    ],
)
def test_headings_are_seen_between_minus_and_plus_half_a_turn(task: Task) -> None:
    kart = OneKart(task)
    for seed in range(40):
        seen, _ = kart.reset(seed=seed)
        assert kart.observation_space.contains(seen)


def test_a_share_of_the_rounds_begins_at_random_places() -> None:
    grid = Batch(ring_task(3)).world.bodies["x"][0]
    begun = Batch(ring_task(3, random_start=0.5), worlds=60).world.bodies["x"]
    on_grid = (begun == grid).all(axis=1)
    assert 15 < on_grid.sum() < 45
    assert not (begun[~on_grid] == grid).any()


def test_who_is_stuck_is_put_back_without_asking() -> None:
    task = ring_task(1, replace(FREE, stuck_s=0.5), action="continuous")
    batch = Batch(task, after=STAY)
    for _ in range(20):
        batch.step(np.zeros((1, 1, 3)))
    assert batch.world.bodies["ghost_until"][0, 0] > 0


def test_every_round_begins_in_an_order_on_the_grid_that_is_drawn() -> None:
    batch = Batch(ring_task(6, random_grid=True), worlds=20, seed=3)
    places = batch.world.racers["grid_place"].copy()
    assert (np.sort(places, axis=1) == np.arange(6)).all()
    assert len(np.unique(places, axis=0)) > 15
    first = np.take_along_axis(batch.world.racers["ranked"], np.argsort(places, axis=1), axis=1)
    assert (np.diff(first, axis=1) < 0.0).all()
    batch.reset()
    assert not np.array_equal(places, batch.world.racers["grid_place"])
    assert np.array_equal(
        places, Batch(ring_task(6, random_grid=True), worlds=20, seed=3).world.racers["grid_place"]
    )


def test_all_karts_of_a_race_start_in_the_same_of_two_directions() -> None:
    batch = Batch(ring_task(4, random_start=True, both_directions=True), worlds=40)
    bodies, racers = batch.world.bodies, batch.world.racers
    # Around the origin, counter-clockwise is where position and heading turn left.
    turn = np.sign(
        bodies["x"] * np.sin(bodies["heading"]) - bodies["y"] * np.cos(bodies["heading"])
    )
    assert (turn == turn[:, :1]).all()
    assert set(turn[:, 0]) == {-1.0, 1.0}
    assert (np.abs(racers["heading_error"]) < 0.3).all()


def test_a_course_driven_the_other_way_round_twice_is_the_course() -> None:
    twice = reversed_course(reversed_course(SMALL_RING))
    assert np.allclose(twice.line[:, [0, 1, 3]], SMALL_RING.line[:, [0, 1, 3]])
    assert np.allclose(twice.gates, SMALL_RING.gates)
    assert np.allclose(twice.grid[:, :2], SMALL_RING.grid[:, :2], atol=0.02)
    assert twice.sectors == SMALL_RING.sectors


def test_a_curriculum_decides_which_scenario_a_reset_draws() -> None:
    short, long = (Scenario(SMALL_RING, karts=2, rules=replace(FREE, laps=n)) for n in (1, 9))
    batch = Batch(task_on((short, long)), worlds=30)
    assert set(batch.world.rules["laps"]) == {1, 9}
    batch.set_odds([0.0, 1.0])
    batch.reset()
    assert set(batch.world.rules["laps"]) == {9}
    with pytest.raises(ScenarioError, match=r"give one for each of the 2 scenarios"):
        batch.set_odds([1.0])
