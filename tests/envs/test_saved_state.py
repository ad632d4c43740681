"""The state of an environment: saved, loaded, copied, and begun from."""

import copy
import pickle
from dataclasses import replace
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

from race_server.envs import registration
from race_server.envs.batch import Batch
from race_server.envs.buffers import REENTER
from race_server.envs.parallel import KartRace, env
from race_server.envs.presets import task_on
from race_server.envs.saved_state import HEADER
from race_server.envs.sb3 import KartVecEnv
from race_server.envs.single import OneKart
from race_server.envs.vector import KartVectorEnv
from race_server.errors import ScenarioError
from race_server.scenario.highway import has_highway
from race_server.scenario.race import Scenario
from support.courses import SMALL_RING
from support.tasks import ring_task


def tape(steps: int, worlds: int, learners: int) -> Any:
    chance = np.random.default_rng(7)
    return chance.uniform(-1.0, 1.0, (steps, worlds, learners, 3)).astype(np.float32)


def digests_after(batch: Batch, actions: Any) -> list[str]:
    for row in actions:
        batch.step(row)
    return [batch.digest(w) for w in range(batch.worlds)]


@pytest.fixture
def batch() -> Batch:
    made = Batch(ring_task(3, opponents=("pure_pursuit",), learners=2), worlds=4, seed=5)
    digests_after(made, tape(30, 4, 2))
    return made


def test_a_thousand_decisions_after_a_saved_state_the_digests_are_the_same(batch: Batch) -> None:
    state, actions = batch.save_state(), tape(1000, 4, 2)
    pickled, copied = pickle.loads(pickle.dumps(batch)), copy.deepcopy(batch)
    first = digests_after(batch, actions)
    batch.load_state(state)
    assert digests_after(batch, actions) == first
    assert digests_after(pickled, actions) == first
    assert digests_after(copied, actions) == first


def test_one_world_goes_on_in_all_others(batch: Batch) -> None:
    state, actions = batch.save_state([2]), tape(50, 4, 2)
    actions[:] = actions[:, 2:3]
    batch.load_state(state)
    assert len(set(digests_after(batch, actions))) == 1
    batch.reset(seed=9)
    batch.load_state(state, [0, 3])
    after = digests_after(batch, actions)
    assert after[0] == after[3]
    assert after[1] != after[0]


def test_a_state_of_another_task_version_or_length_is_refused(batch: Batch) -> None:
    state = batch.save_state()
    other = Batch(ring_task(2), worlds=4)
    with pytest.raises(ScenarioError, match="of another task"):
        other.load_state(state)
    with pytest.raises(ScenarioError, match="cut off"):
        batch.load_state(state[:-1])
    with pytest.raises(ScenarioError, match="version 1"):
        batch.load_state(state[:4] + b"\1" + state[5:])
    with pytest.raises(ScenarioError, match="4 worlds for 3"):
        batch.load_state(state, [0, 1, 2])
    with pytest.raises(ScenarioError, match="take one from save_state"):
        batch.load_state(b"")
    assert len(state) > HEADER.size


def test_a_hundred_restarts_from_one_moment_have_a_hundred_futures_of_one_past() -> None:
    race = KartRace(ring_task(2))
    race.reset(seed=1)
    for _ in range(20):
        race.step(dict.fromkeys(race.agents, np.array([1.0, 0.1, 0.0], np.float32)))
    moment, tick = race.save_state(), int(race.batch.world.races[0].tick)
    begun = race.batch.digest()
    for seed in range(100):
        seen, _ = race.reset(seed=seed, options={"state": moment})
        assert list(seen) == ["kart_0", "kart_1"]
        assert race.batch.world.races[0].tick == tick
        assert race.batch.world.races[0].seed == seed
    race.reset(options={"state": moment})
    assert race.batch.digest() == begun


def test_an_agent_that_has_left_is_still_gone_in_a_saved_state() -> None:
    race = KartRace(ring_task(2), max_cycles=3)
    race.reset(seed=1)
    for _ in range(2):
        race.step({})
    copied = copy.deepcopy(race)
    assert not any(race.step({})[2].values())
    assert race.agents == []
    state = race.save_state()
    race.reset()
    assert race.load_state(state) == {}
    assert copied.agents == ["kart_0", "kart_1"]
    assert all(copied.step({})[3].values())


def test_the_other_forms_go_on_where_they_were() -> None:
    one, rest = OneKart(ring_task(1)), np.array([1.0, 0.2, 0.0], np.float32)
    one.reset(seed=4)
    state = one.save_state()
    seen = one.step(rest)[0]
    one.load_state(state)
    assert np.array_equal(one.step(rest)[0], seen)
    assert np.array_equal(pickle.loads(pickle.dumps(one)).step(rest)[0], one.step(rest)[0])
    for form in (KartVectorEnv, KartVecEnv):
        many: Any = form(ring_task(1), worlds=3)
        assert np.array_equal(many.load_state(state)[2], one.load_state(state))
        after = many.save_state()
        seen = many.step(np.tile(rest, (3, 1)))[0]
        copied = copy.deepcopy(many)
        many.load_state(after)
        assert np.array_equal(many.step(np.tile(rest, (3, 1)))[0], seen)
        assert np.array_equal(
            copied.step(np.tile(rest, (3, 1)))[0], many.step(np.tile(rest, (3, 1)))[0]
        )


@pytest.mark.parametrize("name", registration.MAKERS)
def test_every_environment_can_be_pickled_and_copied(name: str) -> None:
    if name == registration.RACETRACK_COMPATIBLE and not has_highway():
        pytest.skip("highway-env is not installed")
    made: Any = gymnasium.make(name, disable_env_checker=True).unwrapped
    made.reset(seed=4)
    made.action_space.seed(4)
    actions = [made.action_space.sample() for _ in range(8)]
    for action in actions[:4]:
        made.step(action)
    others = [copy.deepcopy(made), pickle.loads(pickle.dumps(made))]
    for action in actions[4:]:
        seen, reward, *ends, _ = made.step(action)
        for other in others:
            seen_there, reward_there, *ends_there, _ = other.step(action)
            assert data_equivalence(seen_there, seen, exact=True)
            assert (reward_there, ends_there) == (reward, ends)


@pytest.mark.parametrize("name", [registration.PARK_GOAL, registration.PARK_TRAILER_GOAL])
def test_a_vehicle_with_goals_goes_on_where_it_was(name: str) -> None:
    made: Any = gymnasium.make(name, disable_env_checker=True).unwrapped
    before, _ = made.reset(seed=4)
    state, ahead = made.save_state(), np.array([1.0, 0.2], np.float32)
    after = made.step(ahead)[0]
    assert data_equivalence(made.load_state(state), before, exact=True)
    assert data_equivalence(made.step(ahead)[0], after, exact=True)


def test_a_race_turn_by_turn_can_be_pickled_and_copied() -> None:
    race = env(karts=2, track="oval")
    race.reset(seed=1)
    race.step(np.float32([1.0, 0.0, 0.0]))
    for other in (copy.deepcopy(race), pickle.loads(pickle.dumps(race))):
        assert other.agent_selection == "kart_1"
        other.step(np.float32([1.0, 0.0, 0.0]))
        assert other.agent_selection == "kart_0"
    race.step(np.float32([1.0, 0.0, 0.0]))
    assert np.array_equal(other.last()[0], race.last()[0])


def test_every_world_has_its_own_seed() -> None:
    task = ring_task(1, random_start=True)
    batch = Batch(task, worlds=3, seed=[4, 9, 4])
    assert batch.digest(0) == batch.digest(2) != batch.digest(1)
    vector = KartVectorEnv(task, worlds=3)
    vector.reset(seed=[4, 9, 4])
    assert [vector.batch.digest(w) for w in range(3)] == [batch.digest(w) for w in range(3)]
    before = vector.batch.digest(1)
    vector.reset(seed=[5, None, 4])
    assert vector.batch.digest(1) != before  # the next round of seed 9
    with pytest.raises(ScenarioError, match="2 seeds for 3"):
        vector.reset(seed=[1, 2])
    with pytest.raises(ScenarioError, match="2 seeds for 3 worlds"):
        batch.reset(seed=[1, 2])


def test_a_reset_takes_a_course_a_grid_and_a_gap() -> None:
    courses = (SMALL_RING, replace(SMALL_RING, name="other"))
    task = task_on(tuple(Scenario(course, karts=2) for course in courses))
    batch = Batch(task, worlds=8, seed=1)
    batch.reset(seed=1, options={"course": "other", "grid": (1, 0), "gap": {"mass": 1.5}})
    assert set(batch.buffers.rounds["scenario"]) == {1}
    assert batch.world.racers["grid_place"].tolist() == [[1, 0]] * 8
    assert batch.draws(0, 1)["mass"] == 1.5
    nominal = task.scenarios[0].vehicle_of(0).mass
    assert batch.world.vehicles["mass"][0, 0] == pytest.approx(1.5 * nominal)
    batch.reset(seed=1)
    assert set(batch.buffers.rounds["scenario"]) == {0, 1}
    assert batch.world.racers["grid_place"].tolist() == [[0, 1]] * 8
    assert batch.draws(0, 1)["mass"] == 1.0


def test_a_gap_that_was_asked_for_holds_for_all_episodes_of_the_round() -> None:
    task = ring_task(3, learners=2, opponents=("pure_pursuit",), most_steps=4)
    batch = Batch(task, seed=1, after=REENTER)
    batch.reset(seed=1, options={"gap": {"mass": 1.5}})
    for _ in range(5):
        batch.step(np.zeros((1, 2, 3)))
    assert batch.buffers.episodes["number"][0].tolist() == [2, 2]
    assert [batch.draws(0, kart)["mass"] for kart in range(2)] == [1.5, 1.5]
    copied = copy.deepcopy(batch)
    for _ in range(4):
        copied.step(np.zeros((1, 2, 3)))
    assert copied.draws(0, 0)["mass"] == 1.5
    batch.reset()
    assert batch.draws(0, 0)["mass"] == 1.0


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"racetrack": "ring"}, "'racetrack' is unknown; choose of course, grid, gap, state"),
        ({"course": "moon"}, "'moon' is not one of the task"),
        ({"grid": (0, 0)}, "give 2 karts one of the places"),
        ({"gap": {"weight": 1.0}}, "gap 'weight' is unknown"),
        ({"gap": {"action_delay": 2}}, "choose 0 to 0"),
        ({"state": b"x", "course": "ring"}, "state says where all begins"),
    ],
)
def test_a_reset_refuses_what_it_cannot_do(options: dict[str, Any], words: str) -> None:
    batch = Batch(ring_task(2))
    with pytest.raises(ScenarioError, match=words):
        batch.reset(options=options)


def test_a_driver_with_a_memory_of_its_own_cannot_be_saved() -> None:
    batch = Batch(ring_task(2, opponents=("unstuck:follow_gap",), learners=1))
    with pytest.raises(ScenarioError, match="driver unstuck:follow_gap keeps its own memory"):
        batch.save_state()
