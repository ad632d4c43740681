"""Stable-Baselines3 on the batch."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from race_server.envs.presets import task_on
from race_server.envs.single import OneKart
from race_server.errors import ScenarioError
from race_server.scenario.race import Scenario
from support.courses import SMALL_RING
from support.tasks import FREE, ring_task

pytest.importorskip("stable_baselines3")

from stable_baselines3.common.env_checker import check_env

from race_server.envs.sb3 import KartVecEnv

CRASHING = replace(FREE, wall_contact="retire")


def test_the_single_environment_keeps_to_sb3() -> None:
    check_env(OneKart(ring_task(1, CRASHING, observation="radar")), warn=False)


def test_an_early_end_is_one_done_with_the_last_observation_and_its_episode() -> None:
    karts = KartVecEnv(ring_task(3, CRASHING), worlds=2, seed=1)
    karts.reset()
    actions = np.zeros((6, 3), np.float32)
    actions[1, 0] = 1.0  # kart 1 of race 0 drives straight into the wall
    steps, dones = 0, np.zeros(6, np.bool_)
    while steps < 80 and not dones.any():
        seen, _, dones, infos = karts.step(actions)
        steps += 1
    assert np.flatnonzero(dones).tolist() == [1]
    info = infos[1]
    assert info["terminal_observation"].shape == seen[1].shape
    assert not np.array_equal(seen[1], info["terminal_observation"])
    assert not karts.step(np.zeros_like(actions))[2].any()
    assert info["TimeLimit.truncated"] is False
    assert info["episode"]["l"] == steps
    assert info["episode"]["crashes"] == 1
    assert {"r", "t", "laps", "best_lap_s"} <= set(info["episode"])
    karts.close()


def test_time_that_runs_out_is_told_apart_from_an_end() -> None:
    karts = KartVecEnv(ring_task(1, CRASHING, most_steps=3), worlds=2)
    karts.reset()
    for _ in range(3):
        _, _, dones, infos = karts.step(np.zeros((2, 3), np.float32))
    assert dones.all()
    assert all(info["TimeLimit.truncated"] for info in infos)


def test_a_curriculum_is_asked_when_episodes_begin_and_end() -> None:
    asked: list[tuple[int, int]] = []

    def harder(decisions: int, episodes: Sequence[dict[str, Any]]) -> list[float] | None:
        asked.append((decisions, len(episodes)))
        return [0.0, 1.0] if episodes else None

    rules = [replace(CRASHING, laps=laps) for laps in (1, 9)]
    task = task_on(tuple(Scenario(SMALL_RING, karts=1, rules=rule) for rule in rules), most_steps=4)
    karts = KartVecEnv(task, worlds=20, curriculum=harder)
    karts.reset()
    assert set(karts.batch.world.rules["laps"]) == {1, 9}
    for _ in range(8):
        karts.step(np.zeros((20, 3), np.float32))
    assert asked == [(0, 0), (80, 20), (160, 20)]
    assert set(karts.batch.world.rules["laps"]) == {9}


def test_options_are_those_of_the_next_reset() -> None:
    karts = KartVecEnv(ring_task(2), worlds=2)
    karts.set_options({"grid": [1, 0]})
    karts.reset()
    places = karts.batch.world.racers["grid_place"]
    assert places.tolist() == [[1, 0], [1, 0]]
    karts.reset()
    assert places.tolist() == [[0, 1], [0, 1]]
    karts.seed(4)
    karts.set_options([{}, {}, {"grid": [1, 0]}, {"grid": [1, 0]}])
    karts.reset()
    assert places.tolist() == [[0, 1], [1, 0]]
    assert karts.batch.buffers.rounds["seed"].tolist() == [4, 5]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"nonsense": 1}, "reset option 'nonsense' is unknown"),
        ([{"grid": [1, 0]}, {}], "options of kart 1 are others than those of kart 0"),
        ([{}], "options of 1 karts for 2"),
    ],
)
def test_options_that_fit_no_race_are_refused(options: Any, words: str) -> None:
    karts = KartVecEnv(ring_task(2))
    karts.set_options(options)
    with pytest.raises(ScenarioError, match=words):
        karts.reset()
