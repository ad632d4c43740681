"""Files for those who install a server agree with the project."""

import re
import shutil
import subprocess
import tomllib
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

import pytest
from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[1]
DEPLOY = ROOT / "deploy"
PIN = re.compile(r"^([A-Za-z0-9._-]+)==([^\s;\\]+)", re.MULTILINE)
SERVICES = sorted(path.name for path in DEPLOY.glob("*.service"))


def pins(path: Path) -> dict[str, str]:
    """Return the versions that a file pins, by normalised name."""
    return {re.sub(r"[-_.]+", "-", name).lower(): v for name, v in PIN.findall(path.read_text())}


def test_every_pinned_release_installs_on_the_oldest_python_that_is_promised() -> None:
    promised = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"]
    oldest = f"{promised.removeprefix('>=')}.0"
    refused = {}
    for name, version in pins(ROOT / "constraints.txt").items():
        try:
            needs = metadata(name)["Requires-Python"] or ""
        except PackageNotFoundError:  # A package for other systems.
            continue
        if oldest not in SpecifierSet(needs):
            refused[f"{name}=={version}"] = needs
    assert refused == {}


@pytest.mark.parametrize("name", ["requirements.txt", "requirements-build.txt"])
def test_every_hashed_version_is_the_one_that_is_tested(name: str) -> None:
    known, locked = pins(ROOT / "constraints.txt"), pins(DEPLOY / name)
    assert locked
    # Packages for other systems, such as colorama for Windows, are not in constraints.txt.
    assert {each: locked[each] for each in locked if each in known} == {
        each: known[each] for each in locked if each in known
    }


@pytest.mark.parametrize("name", ["requirements.txt", "requirements-build.txt"])
def test_every_version_has_hashes(name: str) -> None:
    blocks = re.split(r"\n(?=\S)", (DEPLOY / name).read_text().strip())
    assert all("--hash=sha256:" in block for block in blocks)


def test_the_hashed_versions_cover_what_the_project_needs() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = project["optional-dependencies"]
    needed = [*project["dependencies"], *extras["keys"], *extras["results"]]
    names = {re.split(r"[<>=\[ ]", each, maxsplit=1)[0].lower() for each in needed}
    assert names <= set(pins(DEPLOY / "requirements.txt"))


@pytest.mark.parametrize("name", SERVICES)
@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is missing")
def test_a_service_is_well_formed_and_little_exposed(name: str, tmp_path: Path) -> None:
    program = tmp_path / "race"
    program.touch(0o755)
    unit = tmp_path / name
    text = (DEPLOY / name).read_text()
    unit.write_text(text.replace("/opt/race-server/bin/race", str(program)))
    verify = ["systemd-analyze", "verify", "--man=no", str(unit)]
    assert subprocess.run(verify, capture_output=True, text=True, check=False).stderr == ""
    # systemd's own scale goes from 0 to 10; 2.0 stands for an exposure of 2 at most.
    exposure = ["systemd-analyze", "security", "--offline=yes", "--threshold=20", str(unit)]
    assert subprocess.run(exposure, capture_output=True, check=False).returncode == 0


def test_the_container_runs_as_an_ordinary_user_and_asks_for_its_health() -> None:
    text = (DEPLOY / "Containerfile").read_text()
    last = text[text.rindex("\nFROM ") :]
    assert "\nUSER 10001" in last
    assert "\nHEALTHCHECK" in last
    assert "healthz" in last
    for copied in re.findall(r"^COPY (?!--)(.+) \S+$", text, re.MULTILINE):
        assert all((ROOT / each).exists() for each in copied.split()), copied


def test_the_container_is_built_from_all_that_the_wheel_holds() -> None:
    text = (DEPLOY / "Containerfile").read_text()
    copied = set(re.findall(r"^COPY (?!--)(\S+) \S+$", text, re.MULTILINE))
    build = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["hatch"]["build"]
    wheel = build["targets"]["wheel"]
    assert {"lots", "agents"} <= {*wheel["force-include"], *wheel["packages"]} <= copied
