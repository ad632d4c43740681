"""Seeds of all sizes, resets without one, and saved states that mean something else elsewhere."""

import copy
import pickle

import gymnasium
import numpy as np
import pytest

from race_server.envs import Batch, KartVectorEnv, parallel_env
from race_server.envs.presets import parking_task, race_task, time_trial_task
from race_server.errors import ScenarioError


def first_of(environment: gymnasium.Env, seed: int | None) -> np.ndarray:
    return environment.reset(seed=seed)[0]


def test_environments_that_got_no_seed_begin_differently() -> None:
    starts = [
        gymnasium.make("Kart/TimeTrial-v0", track="oval", random_start=True).reset()[0]
        for _ in range(2)
    ]
    assert not np.array_equal(*starts)
    races = [parallel_env(track="oval", karts=2, random_start=True).reset()[0] for _ in range(2)]
    assert not np.array_equal(races[0]["kart_0"], races[1]["kart_0"])


def test_copies_of_an_environment_that_got_no_seed_begin_differently() -> None:
    made = gymnasium.make("Kart/TimeTrial-v0", track="oval", random_start=True).unwrapped
    packed = pickle.dumps(made)
    copies = [copy.deepcopy(made), *(pickle.loads(packed) for _ in range(2))]
    assert len({one.reset()[0].tobytes() for one in copies}) == 3
    made.reset(seed=1)
    followers = [copy.deepcopy(made), pickle.loads(pickle.dumps(made)), made]
    assert len({one.reset()[0].tobytes() for one in followers}) == 1


def test_with_a_seed_all_is_as_before_and_the_next_rounds_follow_from_it() -> None:
    def rounds() -> list[np.ndarray]:
        environment = gymnasium.make("Kart/TimeTrial-v0", track="oval", random_start=True)
        return [first_of(environment, seed) for seed in (7, None, None)]

    assert np.array_equal(rounds(), rounds())


@pytest.mark.parametrize("seed", [0, 2**31, 2**63 - 1, 2**63, 2**100 + 5])
def test_every_whole_number_is_a_seed(seed: int) -> None:
    vector = KartVectorEnv(time_trial_task("oval", random_start=True), worlds=2)
    assert np.array_equal(vector.reset(seed=seed)[0], vector.reset(seed=seed)[0])


def test_a_world_of_a_vector_that_gets_no_seed_draws_one_of_its_own() -> None:
    def seeds_after(*resets: dict) -> list[int]:
        vector = KartVectorEnv(time_trial_task("oval", random_start=True), worlds=2)
        for each in resets:
            vector.reset(**each)
        return vector.batch.buffers.rounds["seed"].tolist()

    both, again = seeds_after({"seed": [None, None]}), seeds_after({"seed": [None, None]})
    assert len({*both, *again}) == 4
    first, second = seeds_after({"seed": [5, None]})
    assert first == 5
    assert second not in {0, 5, 6}
    only_the_first = {"options": {"reset_mask": np.array([True, False])}}
    assert seeds_after(only_the_first)[1] == 0
    assert seeds_after(only_the_first, {})[1] != 0


def test_a_world_that_has_a_seed_keeps_it() -> None:
    vector = KartVectorEnv(time_trial_task("oval", random_start=True), worlds=2)
    vector.reset(seed=[5, 8])
    vector.reset(seed=[None, None])
    vector.reset()
    assert vector.batch.buffers.rounds["seed"].tolist() == [5, 8]


def test_a_reset_with_a_saved_state_knows_what_the_form_had_added() -> None:
    race = parallel_env(track="oval", karts=2, max_cycles=30)
    race.reset(seed=1)
    for _ in range(20):
        race.step({})
    race.reset(options={"state": race.save_state()})
    for _ in range(10):
        assert race.agents
        race.step({})
    assert not race.agents  # cut off after 30 decisions in all


def test_an_episode_that_was_over_in_a_saved_state_begins_again_with_the_next_step() -> None:
    task = time_trial_task("oval", most_steps=5)
    vector = KartVectorEnv(task, worlds=1, autoreset_mode="NextStep")
    vector.reset(seed=1)
    still = np.zeros((1, 3), np.float32)
    for _ in range(5):
        over = vector.step(still)[3]
    assert over.tolist() == [True]
    vector.reset(options={"state": vector.save_state()})
    lengths = [bool(vector.step(still)[3][0]) for _ in range(12)]
    assert lengths.index(True) == 5  # one step to begin, and five decisions


@pytest.mark.parametrize(
    "changed",
    [
        {"observation": ("steering", "speed")},
        {"action": "discrete"},
        {"decision_ticks": 6},
        {"track": "covapsy-train-2023"},
    ],
)
def test_a_state_of_another_task_is_refused(changed: dict) -> None:
    usual = {"track": "oval", "observation": ("speed", "steering")}
    state = Batch(time_trial_task(**usual)).save_state()
    Batch(time_trial_task(**usual, reward={"progress": 2.0})).load_state(state)
    with pytest.raises(ScenarioError, match="of another task"):
        Batch(time_trial_task(**{**usual, **changed})).load_state(state)


def test_a_state_of_another_level_is_refused() -> None:
    state = Batch(parking_task("face-to-face", level="parked")).save_state()
    with pytest.raises(ScenarioError, match="level"):
        Batch(parking_task("face-to-face", level="report-a-1")).load_state(state)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"grid": 5}, "give a place for each kart"),
        ({"grid": ["a"]}, "give a place for each kart"),
        ({"gap": [1]}, "give factors by name"),
    ],
)
def test_options_of_a_wrong_kind_are_refused_in_one_sentence(options: dict, words: str) -> None:
    race = parallel_env(track="oval", karts=2)
    with pytest.raises(ScenarioError, match=words):
        race.reset(options=options)


def test_numbers_that_make_no_episodes_are_refused() -> None:
    for name, value in (("decision_ticks", 0), ("most_steps", -1), ("reward", {"lap": np.nan})):
        with pytest.raises(ScenarioError, match=f"{name}.* = "):
            race_task("oval", **{name: value})
    task = time_trial_task("oval")
    for count in ({"worlds": 0}, {"threads": 0}, {"threads": -1}):
        with pytest.raises(ScenarioError, match="choose a whole number, 1 at least"):
            Batch(task, **count)
    batch = Batch(task)
    with pytest.raises(ScenarioError, match="choose of 0 to 0"):
        batch.reset(5, worlds=[-1])
    with pytest.raises(ScenarioError, match="weights"):
        batch.set_odds([np.inf])


def test_as_many_seeds_as_environments_are_needed_in_the_compatible_vector() -> None:
    vector = gymnasium.make_vec("Kart/ParkCompatible-v0", num_envs=2)
    seen = vector.reset(seed=[1, None])[0]
    assert np.array_equal(
        seen["observation"][0], vector.reset(seed=np.int64(1))[0]["observation"][0]
    )
    with pytest.raises(ScenarioError, match="3 seeds for 2 environments"):
        vector.reset(seed=[1, 2, 3])


def test_an_agent_without_a_discrete_action_rolls_on() -> None:
    def speeds(of_kart_0: dict) -> np.ndarray:
        race = parallel_env(track="oval", karts=2, action="discrete")
        race.reset(seed=1)
        for _ in range(100):
            race.step({"kart_0": 14, "kart_1": 14})
        for _ in range(10):
            race.step({"kart_1": 14} | of_kart_0)
        return race.batch.world.bodies["speed"][0].copy()

    assert np.array_equal(speeds({}), speeds({"kart_0": 7}))
    assert not np.array_equal(speeds({}), speeds({"kart_0": 0}))
