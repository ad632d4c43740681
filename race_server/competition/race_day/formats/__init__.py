"""The formats of a race day: one file each, found by name.

A module in this folder that holds a `FORMAT` is a format; nothing else has to be changed.
"""

import importlib
import pkgutil
from functools import cache

from race_server.competition.race_day.formats.format import Format, Obstacles, Races, TimeTrial
from race_server.errors import ScenarioError

__all__ = ["Format", "Obstacles", "Races", "TimeTrial", "format_named", "formats"]


@cache
def formats() -> dict[str, Format]:
    """Return all formats by name."""
    found = {}
    for entry in sorted(pkgutil.iter_modules(__path__), key=lambda entry: entry.name):
        module = importlib.import_module(f"{__name__}.{entry.name}")
        known = getattr(module, "FORMAT", None)
        if isinstance(known, Format):
            found[known.name] = known
    return found


def format_named(name: str) -> Format:
    """Return the format called `name`.

    Raises:
        ScenarioError: there is none.
    """
    if name not in formats():
        raise ScenarioError(f"format {name!r} is unknown; choose one of {', '.join(formats())}")
    return formats()[name]
