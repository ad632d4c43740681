"""Fixtures of the tests of competitions."""

from dataclasses import replace

import pytest

from race_server.competition.time_trial.run import Run, drive_run
from support.trials import OVAL


@pytest.fixture(scope="session")
def driven() -> Run:
    """Return one run of two laps on the oval."""
    return drive_run(replace(OVAL, laps=2))
