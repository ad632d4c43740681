"""Fixtures of the tests of agents."""

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from race_agents.training.run import TrainingResult
    from support.trainings import Train


@pytest.fixture(scope="session")
def outcome(trained: "Train") -> "TrainingResult":
    """A run of two thousand decisions."""
    from support.trainings import QUICK

    return trained("time-trial-ppo", QUICK)


@pytest.fixture
def policy_file(outcome: "TrainingResult") -> Path:
    return outcome.folder / "policy.onnx"
