"""What a release holds: one owner for each import name, all that races need, in wheel and sdist."""

import subprocess
import sys
import tarfile
import tomllib
import zipfile
from pathlib import Path

import pytest

pytest.importorskip("hatchling", reason="hatchling builds the wheel")

from race_server.live.gateway.page import is_built

ROOT = Path(__file__).parents[1]


def wheel_of(source: Path, folder: Path) -> set[str]:
    """Return the names of all files in the wheel of a source folder."""
    build(source, folder, "wheel")
    (wheel,) = folder.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        return set(archive.namelist())


def build(source: Path, folder: Path, target: str) -> None:
    command = [sys.executable, "-m", "hatchling", "build", "-t", target, "-d", str(folder)]
    subprocess.run(command, cwd=source, check=True, capture_output=True)


@pytest.fixture(scope="module")
def names(tmp_path_factory: pytest.TempPathFactory) -> set[str]:
    """The names of all files in a wheel of this repository."""
    return wheel_of(ROOT, tmp_path_factory.mktemp("wheel"))


def test_a_wheel_owns_two_import_names_and_neither_is_agents(names: set[str]) -> None:
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"race_server", "race_agents"}


def test_a_wheel_holds_tracks_lots_schemas_policies_and_presets(names: set[str]) -> None:
    for folder, inside, pattern in (
        ("tracks", "race_server/tracks", "*.toml"),
        ("lots", "race_server/lots", "*.toml"),
        ("tracks/limits", "race_server/tracks/limits", "*.npz"),
        ("schemas", "race_server/schemas", "*.fbs"),
        ("race_server/net/wire/generated", "race_server/net/wire/generated", "*.bfbs"),
        ("agents/policies", "race_agents/policies", "*.onnx"),
        ("agents/training/presets", "race_agents/training/presets", "*.toml"),
    ):
        files = [path.name for path in (ROOT / folder).glob(pattern)]
        assert files
        assert {f"{inside}/{name}" for name in files} <= names


@pytest.mark.skipif(not is_built(), reason="the page is not built: make page")
def test_a_wheel_holds_the_page(names: set[str]) -> None:
    assert "race_server/live/gateway/page/index.html" in names
    assert any(name.startswith("race_server/live/gateway/page/assets/") for name in names)


@pytest.mark.slow
def test_a_wheel_built_from_the_sdist_holds_the_same_files(names: set[str], tmp_path: Path) -> None:
    build(ROOT, tmp_path, "sdist")
    (sdist,) = tmp_path.glob("*.tar.gz")
    with tarfile.open(sdist) as archive:
        assert not any("node_modules" in name for name in archive.getnames())
        archive.extractall(tmp_path, filter="data")
    assert wheel_of(tmp_path / sdist.name.removesuffix(".tar.gz"), tmp_path) == names


def test_pipx_run_finds_the_program() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    assert project["entry-points"]["pipx.run"] == {project["name"]: project["scripts"]["race"]}
