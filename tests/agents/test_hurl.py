"""HuRL: how a heuristic is believed less and less, and what a replay buffer makes of it."""

import math
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium import spaces

from race_agents.training.budget import Budget
from race_agents.training.hurl import FORETOLD, Mixing, MixingBuffer, foretold_of, mixing_at
from race_agents.training.learner import learner_of, world_of
from race_agents.training.parking_settings import HurlSettings
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from race_server.errors import ScenarioError

TINY = {
    "sac": "{batch_size = 16, learning_starts = 20, gamma = 0.9}",
    "td3": "{batch_size = 16, learning_starts = 20, gamma = 0.9}",
    "ppo": "{n_steps = 20, batch_size = 20, n_epochs = 1, gamma = 0.9}",
}


def tiny(algorithm: str = "sac", *changes: str) -> Settings:
    """Settings of a second: one slot 5 m ahead, 2 s for each way."""
    return read_settings(
        "parking-1",
        [
            *("steps=120", "worlds=2", "network.layers=[8]", "observation=park"),
            *("parking.lots=['face-to-face']", "parking.limit_s=2.0", "parking.shaping=hurl"),
            *("evaluation=none", "evaluation.score=success"),
            *(f"algorithm.name={algorithm}", f"algorithm.options={TINY[algorithm]}", *changes),
        ],
    )


def learned(settings: Settings) -> Any:
    """Return a learner after its training."""
    budget = Budget.of(settings)
    world = world_of(settings, budget)
    learner = learner_of(settings, world, budget, None)
    callbacks = [Mixing(settings, budget)] if settings.mixes else []
    learner.learn(budget.steps_left, callback=callbacks)
    world.close()
    return learner


def test_the_mixing_rises_from_its_first_value_to_1_once_an_epoch() -> None:
    hurl = HurlSettings(first=0.9, epochs=11)
    shares = np.linspace(0.0, 1.0, 111)
    mixings = [mixing_at(float(share), hurl) for share in shares]
    assert mixings[0] == mixings[9] == 0.9
    assert mixings[-1] == pytest.approx(1.0)
    assert mixings == sorted(mixings)
    assert len(set(mixings)) == 11
    rise = math.tanh(0.5 * math.atanh(0.99)) / 0.99  # in epoch 5 of 0 to 10
    assert mixing_at(5.5 / 11.0, hurl) == pytest.approx(0.9 + 0.1 * rise)


def test_what_is_foretold_is_a_return() -> None:
    # 2 m at 1 m/s are 20 decisions of 0.1 s.
    settings = tiny("sac", "hurl={prize = 100.0, cost = 1.0, speed = 1.0}")
    at_the_slot, away = foretold_of(np.array([0.0, 2.0]), settings)
    assert at_the_slot == 100.0
    assert away == pytest.approx(100.0 * 0.9**20 - (1.0 - 0.9**20) / 0.1)
    undiscounted = tiny("ppo", "algorithm.options.gamma=1.0", "hurl={prize = 100.0, cost = 1.0}")
    assert foretold_of(np.array([2.0]), undiscounted).tolist() == pytest.approx([80.0])


def test_a_buffer_adds_what_is_foretold_when_a_transition_is_drawn() -> None:
    box = spaces.Box(-1.0, 1.0, (3,), np.float32)
    buffer = MixingBuffer(8, box, box, n_envs=2)
    rows = np.zeros((2, 3), np.float32)
    infos = [{FORETOLD: 10.0}, {FORETOLD: 20.0}]
    buffer.add(rows, rows, rows, np.array([1.0, 2.0]), np.array([False, False]), infos)
    assert set(buffer.sample(50).rewards.ravel().tolist()) == {1.0, 2.0}
    buffer.bonus = 0.1
    assert set(buffer.sample(50).rewards.ravel().tolist()) == {2.0, 4.0}


@pytest.mark.parametrize("algorithm", ["sac", "ppo"])
def test_nothing_is_foretold_at_an_end_but_at_a_cut(algorithm: str) -> None:
    settings = tiny(algorithm, "hurl.prize=100.0", "parking.level=goal", "parking.limit_s=3.0")
    world = world_of(settings, Budget.of(settings))
    world.reset()
    ends = cuts = 0
    for _ in range(60):
        # One drives to the slot, the other stands until its time is up.
        *_, dones, infos = world.step(np.array([[1.0, 0.0], [0.0, 0.0]], np.float32))
        for done, info in zip(dones, infos, strict=True):
            is_cut = bool(done and info["TimeLimit.truncated"])
            assert bool(info[FORETOLD] == 0.0) is bool(done and not is_cut)
            ends, cuts = ends + int(done and not is_cut), cuts + int(is_cut)
    assert (ends, cuts) == (3, 2)
    world.close()


@pytest.mark.parametrize("algorithm", ["sac", "td3", "ppo"])
def test_with_a_mixing_of_1_it_is_the_task_itself_to_the_bit(algorithm: str) -> None:
    hurl = learned(tiny(algorithm, "hurl.first=1.0"))
    plain = learned(tiny(algorithm, "parking.shaping=difference", "parking.heuristic='none'"))
    for name, weights in plain.policy.state_dict().items():
        assert torch.equal(hurl.policy.state_dict()[name], weights), name


def test_the_discount_of_the_targets_is_mixed_and_something_else_is_learned() -> None:
    believing = learned(tiny("sac", "hurl={first = 0.5, epochs = 1000000}"))
    assert believing.gamma == pytest.approx(0.45, abs=1e-4)
    assert believing.replay_buffer.bonus == pytest.approx(0.45, abs=1e-4)
    plain = learned(tiny("sac", "parking.shaping=difference", "parking.heuristic='none'"))
    pairs = zip(believing.policy.parameters(), plain.policy.parameters(), strict=True)
    assert not all(torch.equal(one, other) for one, other in pairs)


def test_hurl_without_a_heuristic_is_refused() -> None:
    with pytest.raises(ScenarioError, match="hurl needs a heuristic"):
        tiny("sac", "parking.heuristic='none'")


def test_a_heuristic_of_the_settings_that_does_not_exist_is_refused() -> None:
    settings = tiny("sac", "parking.heuristic=astar")
    with pytest.raises(ScenarioError, match="heuristic 'astar' is unknown; choose one of none"):
        world_of(settings, Budget.of(settings))
