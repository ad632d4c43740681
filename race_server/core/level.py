"""How well a vehicle has to stand in its slot to be parked."""

from dataclasses import dataclass

from race_server.core.clock import TICK_S, ticks_of
from race_server.core.records import Record

_LENGTHS = ("within", "along", "across", "turn", "still", "leave", "hitch")
_CHOICES = ("fits", "last")


@dataclass(frozen=True)
class Level:
    """Tolerances of a parked body. Zero: does not matter.

    Each box of a vehicle with trailers has a place in the slot: where it would be if all stood
    straight in the middle.
    """

    within: float = 0.0  # [m] of its middle from the slot's
    along: float = 0.0  # [m] the same along the slot
    across: float = 0.0  # [m] and across it
    turn: float = 0.0  # [rad] between the headings
    still: float = 0.0  # [m/s] slower than this
    fits: bool = False  # all corners of all boxes inside the slot
    hold_s: float = 0.0  # [s] for this time
    leave: float = 0.0  # [m] from the slot; farther away it has left
    hitch: float = 0.0  # [rad] at any hitch
    last: bool = False  # the box of the last trailer is judged, and not that of the vehicle

    @staticmethod
    def of(parker: Record) -> "Level":
        """Return the tolerances in a PARKER record."""
        figures = {name: float(parker[name]) for name in _LENGTHS}
        hold_s = int(parker["hold_ticks"]) * TICK_S
        fits, last = (bool(parker[name]) for name in _CHOICES)
        return Level(**figures, fits=fits, last=last, hold_s=hold_s)

    def fill(self, parker: Record) -> None:
        """Write the tolerances into a PARKER record."""
        for name in (*_LENGTHS, *_CHOICES):
            parker[name] = getattr(self, name)
        parker["hold_ticks"] = ticks_of(self.hold_s)
