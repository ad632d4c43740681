"""Sets of courses by name, and courses the other way round."""

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from race_server.errors import ScenarioError
from race_server.scenario.track.course import Course
from race_server.scenario.track.load import load_course
from race_server.scenario.track.reverse import reversed_course

SETS = Path(__file__).with_name("track_sets.toml")
REVERSED = "-reversed"


def track_sets() -> dict[str, dict[str, Any]]:
    """Return the tables of all named sets."""
    return tomllib.loads(SETS.read_text(encoding="utf-8"))


def set_named(name: str) -> list[str]:
    """Return the names of all tracks of a set.

    Raises:
        ScenarioError: there is no such set.
    """
    sets = track_sets()
    if name not in sets:
        raise ScenarioError(f"track set {name!r} is unknown; choose one of {', '.join(sets)}")
    table = sets[name]
    first = table.get("first_seed", 0)
    inner = [one for part in table.get("sets", []) for one in set_named(part)]
    names = [*inner, *table.get("tracks", [])]
    scale = f":{table['scale']}" if "scale" in table else ""
    for kind in ("block", "spline", "circuit"):
        numbers = range(first, first + table.get(f"{kind}s", 0))
        names += [f"generated:{kind}:{number}{scale}" for number in numbers]
    return names


def names_of(names: Iterable[str], track_set: str = "") -> tuple[str, ...]:
    """Return the names of all wanted tracks: those named, then those of a set.

    Raises:
        ScenarioError: the set is unknown, or there is no track at all.
    """
    chosen = [*names, *(set_named(track_set) if track_set else ())]
    if not chosen:
        raise ScenarioError("tracks: neither a set nor a name; give one, such as set = 'train'")
    return tuple(dict.fromkeys(chosen))


def course_named(name: str) -> Course:
    """Return a course by name; with ``-reversed`` behind it the other way round.

    Raises:
        TrackError: there is none.
    """
    if name.endswith(REVERSED):
        return reversed_course(load_course(name.removesuffix(REVERSED)))
    return load_course(name)
