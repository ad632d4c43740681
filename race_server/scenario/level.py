"""Tolerances of a parked vehicle by name."""

from collections.abc import Mapping
from math import radians
from types import MappingProxyType

from race_server.core.level import Level
from race_server.errors import ScenarioError

# The first two: report on automatic parking of a kart, 2022, its scenarios 1 and 2. `precise` is
# what is asked of a carmaker's planner (HOPE, arXiv 2405.20579), `dock` of a lorry
# (gym-truck-backerupper).
LEVELS: Mapping[str, Level] = MappingProxyType(
    {
        "report-a-1": Level(within=0.5, leave=30.0),
        "report-a-2": Level(within=0.5, hold_s=1.0),
        "parked": Level(
            along=0.30,
            across=0.15,
            turn=radians(3.0),
            still=0.05,
            fits=True,
            hold_s=1.0,
            hitch=radians(5.0),
        ),
        "precise": Level(
            along=0.05,
            across=0.05,
            turn=0.01,
            still=0.05,
            fits=True,
            hold_s=1.0,
            hitch=radians(2.0),
        ),
        # For hindsight: no time to hold, so that a pose alone tells whether it is reached.
        "goal": Level(within=0.5, turn=radians(10.0)),
        "goal-trailer": Level(within=1.0, turn=radians(10.0), hitch=radians(10.0)),
        "dock": Level(within=0.15, turn=0.1, still=0.05, last=True),
        # Report on an articulated vehicle that learns to park: it prints no tolerance, so the metre
        # is our choice. Whether the trailer is aligned is told apart.
        "report-c": Level(within=1.0),
    }
)


def level_named(name: str) -> Level:
    """Return the tolerances of a name.

    Raises:
        ScenarioError: there are none.
    """
    if not isinstance(name, str) or name not in LEVELS:
        raise ScenarioError(f"level {name!r} is unknown; choose one of {', '.join(LEVELS)}")
    return LEVELS[name]


def name_of_level(level: Level | None) -> str:
    """Return the name of tolerances; "" of those that have none."""
    return next((name for name, known in LEVELS.items() if known == level), "")
