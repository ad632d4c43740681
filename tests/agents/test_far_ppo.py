"""Rollouts that runners collect: the same lessons, counted once."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stable_baselines3.common.running_mean_std import RunningMeanStd

from race_agents.policies.session import Policy
from race_agents.training import curve
from race_agents.training.far_ppo import HereCrew, check_far, worlds_of_each
from race_agents.training.far_runner import Moments, moments_since
from race_agents.training.run import train
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from race_server.core.seeds import RESUMED, resumed_seed
from race_server.errors import ScenarioError
from support.trainings import QUICK


def settings_of(*changes: str) -> Settings:
    words = ("steps=1600", "worlds=4", "evaluation.seconds=1.0", "warm_start.teacher=", *changes)
    return read_settings("time-trial-ppo", [*QUICK, *words])


def learned(place: Path, runners: int, **options: Any) -> dict[str, Any]:
    """Train with runners in this process, or without."""
    place.mkdir(exist_ok=True)
    crew = HereCrew(settings_of(), runners) if runners else None
    return train(settings_of(), place, crew=crew, **options).evaluation


def test_one_runner_brings_what_the_learner_collects_by_itself(tmp_path: Path) -> None:
    figures = [learned(tmp_path / str(runners), runners) for runners in (0, 1)]
    assert [one["steps"] for one in figures] == [1600, 1600]
    policies = [Policy(tmp_path / str(runners) / "policy.onnx") for runners in (0, 1)]
    size = sum(policies[0].metadata.sizes)
    seen = np.random.default_rng(1).uniform(0.0, 5.0, (50, size)).astype(np.float32)
    alone, far = (policy.decide(seen) for policy in policies)
    assert far == pytest.approx(alone, abs=1e-4)


def test_two_runners_share_the_worlds(tmp_path: Path) -> None:
    assert learned(tmp_path / "two", 2)["steps"] == 1600


def test_the_moments_of_new_rows_are_found_again() -> None:
    rows = np.random.default_rng(0).normal(5.0, 3.0, (80, 2))
    means = RunningMeanStd(shape=(2,))
    means.update(rows[:50])
    before = Moments(means.mean.copy(), means.var.copy(), means.count)
    means.update(rows[50:])
    found = moments_since(before, means)
    assert found.rows == pytest.approx(30.0)
    assert found.mean == pytest.approx(rows[50:].mean(axis=0))
    assert found.variance == pytest.approx(rows[50:].var(axis=0))


def test_a_run_that_was_killed_learns_again_what_no_checkpoint_knows(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    for steps in (100, 200, 300):
        curve.append(path, curve.Point(1.0, steps, 10.0, 1e-3))
    curve.cut(path, 200)
    assert [line.split(",")[1] for line in path.read_text().splitlines()] == ["steps", "100", "200"]


def test_a_training_resumes_with_seeds_of_32_bits_however_long_it_has_learned() -> None:
    assert resumed_seed(1, 400) == 2**31 + 401
    for done in (2**31, 2_200_000_000, 10**12):
        assert RESUMED <= resumed_seed(1, done) < 2**32 - 999_999


def test_worlds_that_cannot_be_shared_evenly_and_what_runners_cannot_do_are_refused() -> None:
    with pytest.raises(ScenarioError, match=r"3 runners: worlds = 4 cannot .* one of 1, 2, 4"):
        worlds_of_each(settings_of(), 3)
    with pytest.raises(ScenarioError, match="curiosity: runners collect for ppo alone"):
        check_far(settings_of("curiosity.bonus=0.1"))
