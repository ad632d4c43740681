"""The formats of an event: one TOML file each, found by name in this folder, or by path."""

from functools import cache
from pathlib import Path

from race_server.competition.race_day.formats.format import (
    LAP,
    RUN,
    Format,
    Obstacles,
    Races,
    TimeTrial,
)
from race_server.competition.race_day.formats.reader import read_format
from race_server.errors import ScenarioError

__all__ = [
    "LAP",
    "RUN",
    "Format",
    "Obstacles",
    "Races",
    "TimeTrial",
    "format_named",
    "formats",
]


@cache
def formats() -> dict[str, Format]:
    """Return the formats that are included, by name."""
    return {path.stem: read_format(path) for path in sorted(Path(__file__).parent.glob("*.toml"))}


def format_named(name: str) -> Format:
    """Return the format called `name`, or that of a .toml file.

    Raises:
        ScenarioError: there is none, or the file holds none.
    """
    if name.endswith(".toml"):
        return read_format(Path(name))
    if name not in formats():
        known = ", ".join(formats())
        raise ScenarioError(f"format {name!r} is unknown; choose one of {known}, or a .toml file")
    return formats()[name]
