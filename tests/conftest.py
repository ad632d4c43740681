"""What all tests share: the kernels are compiled once, and the longest files come first."""

import gc
import os
import signal
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING
from unittest.mock import patch

import hypothesis
import numpy as np
import pytest

# No test writes to the results of the user that runs it.
os.environ["RACE_SERVER_RESULTS"] = "none"
os.environ["RACE_SERVER_RECORDINGS"] = "none"
# Races of tests are not watched.
os.environ["RACE_SERVER_PAGE"] = "0"

from race_server.live.server.warm_up import warm_up
from race_server.scenario.race import Scenario, make_world
from support.courses import ring

if TYPE_CHECKING:
    from race_agents.training.run import TrainingResult
    from support.trainings import Train

# A compiler makes millions of objects that stay: to look through them takes a tenth of its time.
gc.set_threshold(100_000)
# The first example of a test may compile a kernel.
hypothesis.settings.register_profile("compiles", deadline=None)
hypothesis.settings.load_profile("compiles")

# The files that take longest, which come first: at the end no process is long at one while the
# others have nothing left. While one process compiles a training in a lot, for `test_hurl`, the
# other has to have enough that needs none.
LONGEST = (
    "live/test_live.py",
    "agents/test_imitation.py",
    "agents/test_hurl.py",
    "live/test_page.py",
    "storage/test_results_of_races.py",
    "envs/test_discipline.py",
    # Of slow tests:
    "docs/test_pages.py",
    "docs/test_site.py",
    "agents/test_judges.py",
    "core/test_modes.py",
)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the longest files first; the tests of each stay in their order."""
    folder = Path(__file__).parent
    places = {folder / name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.path, len(places)))


def called_kernels() -> list[str]:
    """Return the names of the kernels that Python has called."""
    from race_server.core.kernels.dispatcher import Kernel

    kernels = (each for each in gc.get_objects() if type(each) is Kernel)
    return sorted(each.__qualname__ for each in kernels if "entry" in vars(each))


@pytest.fixture(scope="session", autouse=True)
def compiled() -> None:
    """Compile (or load) what a live race calls before the first test is timed.

    The second of several processes compiles what a training calls as well, and in another order:
    where both begin with the same kernel, one waits for the other.
    """
    if called := called_kernels():  # each process waited for them
        pytest.fail(f"a file of tests calls {', '.join(called)} as it is imported")
    scenario = Scenario(ring(), karts=2)
    if os.environ.get("PYTEST_XDIST_WORKER") == "gw1":
        compile_training(scenario)
    warm_up(scenario, ("pure_pursuit", "follow_gap", "avoider"))


@pytest.fixture(autouse=True)
def own_environment() -> Iterator[None]:
    """Undo what a test sets in the environment; `race drive` lets kernels be interpreted."""
    with patch.dict(os.environ):
        yield


@pytest.fixture
def handlers() -> Iterator[None]:
    """Give the signals back to pytest, which a server takes for itself."""
    before = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


def compile_training(scenario: Scenario) -> None:
    """Compile the tick, then a decision of a training."""
    from race_server.core.kernels.jit import bind
    from race_server.core.step import advance
    from race_server.envs.batch import Batch
    from race_server.envs.presets import task_on

    # A world with no kart on its grid place: to place one calls what the first process compiles.
    with patch("race_server.scenario.race.line_up_race"):
        world = make_world(scenario)
    bind(advance, world, np.zeros((1, scenario.karts, 4)), 1)
    Batch(task_on((scenario,)))


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
