"""The training world: one race among many, its ends and its resets."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np

from race_server.core import codes
from race_server.core.driver import driver_named
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.envs.batch import Batch
from race_server.envs.buffers import REENTER, RESET_WORLD, STAY
from race_server.envs.parallel import KartRace
from race_server.envs.presets import race_task, task_on
from race_server.envs.task import Task
from race_server.live.local_drivers import briefing_for
from race_server.scenario.race import Scenario
from race_server.session.session import Session
from support.courses import SMALL_RING
from support.tasks import FREE, ring_task


def wandering(batch: Batch, steps: int, seed: int = 3) -> list[np.ndarray]:
    chance = np.random.default_rng(seed)
    shape = batch.buffers.actions[0].shape
    return [chance.uniform(-1.0, 1.0, shape).astype(np.float32) for _ in range(steps)]


# One race among many


def test_world_17_of_64_is_the_same_world_alone_for_5000_ticks() -> None:
    task = race_task(karts=3, opponents=("avoider",), learners=2, most_steps=200)
    many = Batch(task, worlds=64, seed=100, after=RESET_WORLD)
    alone = Batch(task, worlds=1, seed=117, after=RESET_WORLD)
    for actions in wandering(alone, 1667):
        many.buffers.actions[:] = actions
        many.step()
        alone.step(actions)
    assert many.buffers.rounds["number"][17] > 3
    assert many.digest(17) == alone.digest()
    assert np.array_equal(many.observations[17], alone.observations[0])
    assert many.digest(16) != alone.digest()


def test_threads_do_not_change_what_happens() -> None:
    one, two = (Batch(ring_task(random_start=True), worlds=5, threads=n) for n in (1, 2))
    for actions in wandering(one, 60):
        for batch in (one, two):
            batch.buffers.actions[:] = actions
            batch.step()
    assert [one.digest(w) for w in range(5)] == [two.digest(w) for w in range(5)]
    two.close()


def test_the_batch_runs_the_very_race_that_a_live_session_runs() -> None:
    names = ("follow_gap", "pure_pursuit", "avoider")
    scenario = Scenario(SMALL_RING, karts=4, rules=replace(FREE, items=True))
    task = task_on((scenario,), opponents=names, learners=1, observation="lidar")
    batch = Batch(task, after=STAY)
    seed = int(batch.world.races["seed"][0])
    session = Session("race", replace(scenario, seed=seed))
    drivers = {}
    session.join("learner", "lidar", wanted=0).is_ready = True
    for seat, name in enumerate(names, start=1):
        driver = driver_named(name)
        taken = session.join(name, driver.preset, wanted=seat)
        taken.is_ready = True
        driver.reset(briefing_for(session, taken))
        drivers[seat] = driver
    session.start()
    for decision in range(200):
        drive = 0.4 if decision % 40 < 30 else 0.0
        batch.step(np.array([[[drive, 0.1, 0.0]]]))
        session.observe()
        seen = {
            seat: Observation(session.tick, session.layout(driver.preset), session.view(seat))
            for seat, driver in drivers.items()
        }
        controls = {seat: driver.act(seen[seat]) for seat, driver in drivers.items()}
        steering, throttle = np.float32(0.1), np.float32(drive)
        controls[0] = Control(float(steering), float(throttle))
        for seat, control in controls.items():
            session.receive_control(seat, session.epoch, decision + 1, session.tick, control)
        session.advance(3)
    session.observe()
    # A session also numbers its own events; all else is the same to the bit.
    session.world.races["sequence"] = batch.world.races["sequence"]
    assert session.digest() == batch.digest()
    assert np.array_equal(session.view(0), batch.observations[0, 0])


# Ends and resets


def crash_task(karts: int = 3) -> Task:
    return ring_task(karts, replace(FREE, wall_contact="retire"), most_steps=400)


def crash_first(batch: Batch) -> np.ndarray:
    """Kart 0 drives straight into the wall, the others stand still."""
    actions = np.zeros_like(batch.buffers.actions[0])
    actions[0, 0] = 1.0
    return actions


def test_a_kart_that_retires_early_gets_one_end_with_its_last_observation() -> None:
    batch = Batch(crash_task(), after=STAY)
    ends, last = [], None
    for step in range(200):
        batch.step(crash_first(batch))
        ends += [(step, kart) for kart in np.flatnonzero(batch.terminated[0])]
        if batch.terminated[0, 0]:
            last = batch.terminal[0, 0].copy()
    assert [kart for _, kart in ends] == [0]
    assert last is not None
    assert np.array_equal(last, batch.observations[0, 0])
    assert batch.world.racers["retired_for"][0, 0] == codes.CRASH
    assert batch.rewards[0, 0] == 0.0


def test_the_others_race_on_after_an_early_end() -> None:
    race = KartRace(crash_task())
    race.reset(seed=1)
    ended: list[str] = []
    for _ in range(200):
        actions = {agent: np.array([1.0 * (agent == "kart_0"), 0.0, 0.0]) for agent in race.agents}
        _, _, over, _, infos = race.step(actions)
        ended += [agent for agent, is_over in over.items() if is_over]
    assert ended == ["kart_0"]
    assert race.agents == ["kart_1", "kart_2"]
    terms = infos["kart_1"]["reward_terms"]
    assert terms[race.batch.terms.index("time")] == 1.0


def test_a_kart_reenters_the_race_that_goes_on_without_it() -> None:
    batch = Batch(crash_task(), after=REENTER)
    tick = 0
    for _ in range(100):
        batch.buffers.memory[:] = 7.0
        batch.step(crash_first(batch))
        if batch.terminated[0, 0]:
            break
        tick = int(batch.world.races["tick"][0])
    assert not batch.buffers.memory[0, 0].any()
    assert batch.buffers.memory[0, 1].all()
    assert batch.terminated[0].tolist() == [1, 0, 0]
    assert batch.world.races["tick"][0] == tick + 3
    assert batch.world.bodies["status"][0, 0] == codes.RACING
    assert batch.buffers.episodes["steps"][0, 0] == 0
    assert batch.buffers.ended["crashes"][0, 0] == 1
    assert not np.array_equal(batch.terminal[0, 0], batch.observations[0, 0])


def test_time_that_runs_out_cuts_an_episode_off() -> None:
    batch = Batch(ring_task(most_steps=5), after=RESET_WORLD)
    cuts = []
    for _ in range(10):
        batch.step(np.zeros((1, 2, 3)))
        cuts.append(batch.truncated[0].tolist())
    assert cuts == ([[0, 0]] * 4 + [[1, 1]]) * 2
    assert not batch.terminated.any()
    assert batch.buffers.rounds["number"][0] == 3


def test_the_same_seed_gives_the_same_race_and_another_seed_another() -> None:
    batch = Batch(ring_task(random_start=True))
    first, again = batch.reset(5).copy(), batch.reset(5).copy()
    other, later = batch.reset(6).copy(), batch.reset().copy()
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)
    assert not np.array_equal(other, later)


EPISODE = """
from race_server.envs.parallel import parallel_env
import numpy as np
race = parallel_env(max_cycles=400)
race.reset(seed=42)
chance = np.random.default_rng(0)
while race.agents:
    race.step({agent: chance.uniform(-1, 1, 3).astype(np.float32) for agent in race.agents})
print(race.batch.digest())
"""


def test_a_whole_episode_repeats_in_another_process() -> None:
    digests = {
        subprocess.run(
            [sys.executable, "-c", EPISODE],
            env={**os.environ, "PYTHONHASHSEED": str(number)},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for number in range(2)
    }
    assert len(digests) == 1
    assert len(digests.pop().strip()) == 32
