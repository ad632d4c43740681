"""The interfaces that other libraries expect: PettingZoo and Gymnasium."""

import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.env_registry.registration import make
from pettingzoo.test import (
    api_test,
    max_cycles_test,
    parallel_api_test,
    parallel_seed_test,
    render_test,
)

from race_server.envs.parallel import env, parallel_env
from support.tasks import ring_task


@pytest.fixture
def headless(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")


def test_the_parallel_environment_keeps_to_pettingzoo() -> None:
    parallel_api_test(parallel_env(max_cycles=120), num_cycles=300)
    parallel_seed_test(parallel_env)


def test_the_turn_based_environment_keeps_to_pettingzoo() -> None:
    api_test(env(max_cycles=60), num_cycles=300, verbose_progress=False)


def test_the_number_of_cycles_is_kept() -> None:
    class Module:
        env = staticmethod(env)
        parallel_env = staticmethod(parallel_env)

    max_cycles_test(Module)


@pytest.mark.usefixtures("headless")
def test_the_environment_renders_as_pettingzoo_wants() -> None:
    pytest.importorskip("pygame")
    render_test(lambda render_mode: env(max_cycles=20, render_mode=render_mode))


@pytest.mark.parametrize("name", ["Kart/TimeTrial-v0", "Kart/Race-v0"])
def test_the_single_environments_keep_to_gymnasium(name: str) -> None:
    made = gymnasium.make(f"race_server:{name}")
    check_env(made.unwrapped, skip_render_check=True)
    made.close()


def test_pettingzoo_makes_the_race_by_its_id() -> None:
    race = make("parallel", "Kart/Race-v0", task=ring_task(3))
    assert race.unwrapped.possible_agents == ["kart_0", "kart_1", "kart_2"]
    assert make("aec", "Kart/Race-v0", task=ring_task(2)).possible_agents == ["kart_0", "kart_1"]


def test_gymnasium_finds_the_ids_in_a_fresh_process() -> None:
    code = "import gymnasium as gym; gym.make('race_server:Kart/TimeTrial-v0').reset(seed=1)"
    subprocess.run([sys.executable, "-c", code], check=True)


def test_gymnasium_makes_a_vector_environment_on_one_batch() -> None:
    vector = gymnasium.make_vec(
        "race_server:Kart/Race-v0", num_envs=6, vectorization_mode="vector_entry_point", karts=3
    )
    seen, _ = vector.reset(seed=1)
    assert seen.shape == vector.observation_space.shape == (6, seen.shape[1])
    seen, rewards, ended, cut, _ = vector.step(vector.action_space.sample())
    assert rewards.shape == ended.shape == cut.shape == (6,)
    vector.close()


def test_a_vector_environment_hands_over_the_last_observation() -> None:
    vector = gymnasium.make_vec(
        "race_server:Kart/TimeTrial-v0",
        num_envs=3,
        vectorization_mode="vector_entry_point",
        most_steps=4,
    )
    vector.reset(seed=1)
    for _ in range(4):
        seen, _, ended, cut, infos = vector.step(np.zeros((3, 3), np.float32))
    assert (ended | cut).all()
    assert infos["final_obs"].shape == seen.shape
    assert infos["episode"]["l"].tolist() == [4, 4, 4]
    vector.close()
