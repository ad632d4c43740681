"""The same source gives the same world whether it is compiled, bounds-checked or interpreted."""

import os
import subprocess
import sys

import pytest

RACE = """
import numpy as np
from race_server.scenario.base import Rules, Scenario, make_world
from race_server.state import digest
from race_server.step import advance
from race_server.track.load import load_course

world = make_world(Scenario(load_course("oval"), karts=3, rules=Rules(countdown_s=0.5)), seeds=[5])
controls = np.zeros((1, 3, 4))
for tick in range(40):
    controls[0, :, 0] = np.sin(0.3 * tick + np.arange(3))
    controls[0, :, 1] = (0.4, 0.7, 1.0)
    advance(world, controls, 3)
rows = world.karts[0]
print(*(f"{value:.9f}" for name in ("x", "y", "heading", "distance") for value in rows[name]))
print(*(f"{value:.4f}" for value in world.sight.lidar[0].ravel()[::50]))
print(int(world.event_counts[0]))
"""


def world_under(**settings: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", RACE],
        env={**os.environ, **settings},
        capture_output=True,
        text=True,
        timeout=300,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def compiled() -> str:
    return world_under()


def test_interpreted_kernels_move_the_same_world(compiled: str) -> None:
    assert world_under(RACE_SERVER_INTERPRET="1") == compiled


@pytest.mark.slow
def test_no_kernel_reads_outside_its_arrays(compiled: str) -> None:
    assert world_under(NUMBA_BOUNDSCHECK="1") == compiled
