"""The same source gives the same world whether it is compiled, bounds-checked or interpreted."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import race_server
from race_server.kernels.jit import kernel_sources

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


PACKAGE = Path(race_server.__file__).parent
# What they raise when a record is made, outside a kernel.
WITHOUT_NUMBERS = {PACKAGE / "errors.py"}


def modules_of(source: Path) -> set[Path]:
    """Return the files of this package that a file imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{each.name}" for each in node.names)}
    places = {PACKAGE.parent / f"{name.replace('.', '/')}.py" for name in names}
    return {place for place in places if place.is_file() and PACKAGE in place.parents}


def test_machine_code_is_old_once_any_file_that_the_world_imports_has_changed() -> None:
    counted = set(kernel_sources())
    floors = [PACKAGE / floor for floor in ("kernels", "rules", "stages")]
    world = {path for floor in floors for path in floor.rglob("*.py")}
    world |= {PACKAGE / "step.py", PACKAGE / "state.py"}
    assert world <= counted
    imported = set().union(*(modules_of(source) for source in world))
    assert PACKAGE / "codes.py" in imported
    assert imported - counted <= WITHOUT_NUMBERS
