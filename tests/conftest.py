"""What all tests share: the kernels are compiled once, and small worlds are quick to make."""

import os
from functools import cache
from typing import TYPE_CHECKING

import pytest

# No test writes to the results of the user that runs it.
os.environ["RACE_SERVER_RESULTS"] = "none"
os.environ["RACE_SERVER_RECORDINGS"] = "none"
# Races of tests are not watched.
os.environ["RACE_SERVER_PAGE"] = "0"

from race_server.live.server.warm_up import warm_up
from race_server.scenario.race import Scenario
from support.courses import ring

if TYPE_CHECKING:
    from race_agents.training.run import TrainingResult
    from support.trainings import Train


@pytest.fixture(scope="session", autouse=True)
def compiled() -> None:
    """Compile (or load) what a live race calls before the first test is timed."""
    warm_up(Scenario(ring(), karts=2))


@pytest.fixture(scope="session")
def trained(tmp_path_factory: pytest.TempPathFactory) -> "Train":
    """Trains by a preset with changes: each training once, in a separate folder."""
    from race_agents.training import folder
    from race_agents.training.run import train
    from race_agents.training.settings_toml import read_settings

    @cache
    def train_by(preset: str, changes: tuple[str, ...]) -> "TrainingResult":
        place = folder.new_folder("quick", tmp_path_factory.mktemp("runs") / "quick")
        return train(read_settings(preset, changes), place)

    return train_by
