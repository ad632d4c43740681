"""What a coach tells one driver: of a lap that ended, or on the way, before a corner."""

from dataclasses import dataclass
from enum import IntEnum


class HintKind(IntEnum):
    """What is to be done otherwise; names and order as in `schemas/codes.fbs`."""

    NONE = 0
    EARLY_BRAKES = 1
    COASTING = 2
    LATE_TURN_IN = 3
    SLOW_BEND = 4
    WIDE_APEX = 5
    LATE_THROTTLE = 6
    LIFT = 7
    SHORT_EXIT = 8
    UNKNOWN = 9


@dataclass(frozen=True)
class Hint:
    """One word to one driver; figures instead of sentences, since pages have their own languages.

    A cue has a corner and no lap.
    """

    lap: int = 0  # number of the lap that ended
    time_us: int = 0  # of it
    behind_us: int | None = None  # what it is behind the limit; None where it is not compared
    reason: str = ""  # why it is not
    kind: HintKind = HintKind.NONE
    corner: str = ""
    size: float = 0.0  # of the fault: [m], of a slow bend [m/s]
    reach: float = 0.0  # [m] from where the limit brakes to the apex; 0 where it needs no brakes
    # Stretches of the course, from and to [m] of progress, in which help that fades is given.
    helped: tuple[tuple[float, float], ...] = ()

    @property
    def is_cue(self) -> bool:
        """Whether it is said on the way."""
        return self.lap == 0
