"""What all tests share: the kernels are compiled once, and small worlds are quick to make."""

import os
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
# No test writes to the results of whoever runs it.
os.environ["RACE_SERVER_RESULTS"] = "none"
os.environ["RACE_SERVER_RECORDINGS"] = "none"
# Races of tests are not watched.
os.environ["RACE_SERVER_PAGE"] = "0"

from courses import ring

from race_server.scenario.base import Scenario, make_world
from race_server.step import advance


@pytest.fixture(scope="session", autouse=True)
def compiled() -> None:
    """Compile (or load) the tick before the first test is timed."""
    import numpy as np

    world = make_world(Scenario(ring(), karts=2))
    advance(world, np.zeros((1, 2, 4)), 1)
