"""How well a vehicle has to stand to be parked."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import radians
from types import MappingProxyType

from race_server.core.clock import ticks_of
from race_server.core.records import Record
from race_server.errors import ScenarioError


@dataclass(frozen=True)
class Level:
    """Tolerances of a parked body. Zero: does not matter."""

    within: float = 0.0  # [m] of its middle from the slot's
    along: float = 0.0  # [m] the same along the slot
    across: float = 0.0  # [m] and across it
    turn: float = 0.0  # [rad] between the headings
    still: float = 0.0  # [m/s] slower than this
    fits: bool = False  # all corners inside the slot
    hold_s: float = 0.0  # [s] for this time
    leave: float = 0.0  # [m] from the slot; farther away it has left

    def fill(self, parker: Record) -> None:
        """Write the tolerances into a PARKER record."""
        for name in ("within", "along", "across", "turn", "still", "leave"):
            parker[name] = getattr(self, name)
        parker["fits"], parker["hold_ticks"] = int(self.fits), ticks_of(self.hold_s)


# The first two: report on automatic parking of a kart, 2022, its scenarios 1 and 2. `precise` is
# what is asked of a carmaker's planner (HOPE, arXiv 2405.20579), `dock` of a lorry
# (gym-truck-backerupper).
LEVELS: Mapping[str, Level] = MappingProxyType(
    {
        "report-a-1": Level(within=0.5, leave=30.0),
        "report-a-2": Level(within=0.5, hold_s=1.0),
        "parked": Level(
            along=0.30, across=0.15, turn=radians(3.0), still=0.05, fits=True, hold_s=1.0
        ),
        "precise": Level(along=0.05, across=0.05, turn=0.01, still=0.05, fits=True, hold_s=1.0),
        # For hindsight: no time to hold, so that a pose alone tells whether it is reached.
        "goal": Level(within=0.5, turn=radians(10.0)),
        "dock": Level(within=0.15, turn=0.1, still=0.05),
    }
)


def level_named(name: str) -> Level:
    """Return the tolerances of a name.

    Raises:
        ScenarioError: there are none.
    """
    if name not in LEVELS:
        raise ScenarioError(f"level {name!r} is unknown; choose one of {', '.join(LEVELS)}")
    return LEVELS[name]
