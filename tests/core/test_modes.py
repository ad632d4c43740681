"""The same source gives the same world whether it is compiled, bounds-checked or interpreted."""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

import race_server
from race_server.core.kernels.jit import kernel_sources

RACE = """
import numpy as np
from race_server.scenario.race import Rules, Scenario, make_world
from race_server.core.state import digest, field_of
from race_server.core.step import advance
from race_server.scenario.track.load import load_course

world = make_world(Scenario(load_course("oval"), karts=3, rules=Rules(countdown_s=0.5)), seeds=[5])
controls = np.zeros((1, 3, 4))
for tick in range(40):
    controls[0, :, 0] = np.sin(0.3 * tick + np.arange(3))
    controls[0, :, 1] = (0.4, 0.7, 1.0)
    advance(world, controls, 3)
for name in ("x", "y", "heading", "distance"):
    print(*(f"{value:.9f}" for value in field_of(world, name)[0]))
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
WITHOUT_NUMBERS = {"race_server.errors"}


def modules_of(source: Path) -> set[str]:
    """Return the modules of our packages that a file imports."""
    names: set[str] = set()
    for node in ast.walk(ast.parse(source.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module:
            names |= {node.module, *(f"{node.module}.{each.name}" for each in node.names)}
    places = {name: PACKAGE.parent / f"{name.replace('.', '/')}.py" for name in names}
    return {name for name, place in places.items() if place.is_file()}


def test_machine_code_is_old_once_any_file_that_the_world_imports_has_changed() -> None:
    counted = kernel_sources()
    floors = [PACKAGE / "core" / floor for floor in ("kernels", "rules", "stages")]
    world = {path for floor in floors for path in floor.rglob("*.py")}
    world |= {PACKAGE / "core/step.py", PACKAGE / "core/state.py"}
    assert len(world) > 25
    assert world <= set(counted.values())
    imported = set().union(*(modules_of(source) for source in world))
    assert "race_server.core.codes" in imported
    assert imported - set(counted) <= WITHOUT_NUMBERS


def holds_kernels(path: Path) -> bool:
    return "core.kernels.jit import" in path.read_text()


def test_every_file_with_a_kernel_in_it_is_counted() -> None:
    everything = [*PACKAGE.rglob("*.py"), *(PACKAGE.parent / "agents").rglob("*.py")]
    kernels = {path for path in everything if "\n@kernel" in path.read_text()}
    counted = {path.resolve() for path in kernel_sources().values()}
    assert PACKAGE.parent / "agents/drivers/raceline.py" in kernels
    # The predictor runs interpreted; the benchmark compiles what it times.
    outside = {PACKAGE / "live/client/predictor.py", PACKAGE / "tools/bench/core.py"}
    assert kernels - counted <= outside


@pytest.fixture
def brought_driver(tmp_path: Path) -> Path:
    """Install a package that offers a driver with a kernel, as another project would."""
    package = tmp_path / "their_racer"
    package.mkdir()
    (package / "__init__.py").write_text("")
    (package / "pilot.py").write_text("from their_racer import gains\nfrom . import habits\n")
    (package / "gains.py").write_text("GAIN = 1.0\n")
    (package / "habits.py").write_text("CAREFUL = True\n")
    (package / "website.py").write_text("TITLE = 'no driver imports this'\n")
    about = tmp_path / "their_racer-1.0.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: their-racer\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(
        "[race_server.drivers]\ntheir_pilot = their_racer.pilot:Pilot\n"
    )
    return tmp_path


def digest_with(path: Path) -> str:
    program = "from race_server.core.kernels.jit import source_digest; print(source_digest())"
    done = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "PYTHONPATH": str(path)},
        capture_output=True,
        text=True,
        check=True,
    )
    return done.stdout


def test_machine_code_of_somebody_elses_driver_is_old_once_its_sources_change(
    brought_driver: Path, tmp_path: Path
) -> None:
    package = brought_driver / "their_racer"
    before = digest_with(brought_driver)
    (package / "website.py").write_text("TITLE = 'changed'\n")
    assert digest_with(brought_driver) == before
    (package / "gains.py").write_text("GAIN = 2.0\n")
    changed = digest_with(brought_driver)
    assert changed != before
    (package / "habits.py").write_text("CAREFUL = False\n")
    assert digest_with(brought_driver) not in {before, changed}
