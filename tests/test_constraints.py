"""Pinned versions go with what the project says it needs."""

import tomllib
from importlib.metadata import PackageNotFoundError, metadata
from pathlib import Path

from packaging.specifiers import SpecifierSet

ROOT = Path(__file__).parents[1]


def test_every_pinned_release_installs_on_the_oldest_python_that_is_promised() -> None:
    promised = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["requires-python"]
    oldest = f"{promised.removeprefix('>=')}.0"
    refused = {}
    for pin in (ROOT / "constraints.txt").read_text().splitlines():
        name, _, _ = pin.partition("==")
        try:
            needs = metadata(name)["Requires-Python"] or ""
        except (PackageNotFoundError, ValueError):  # A comment, or a package for other systems.
            continue
        if oldest not in SpecifierSet(needs):
            refused[pin] = needs
    assert refused == {}
