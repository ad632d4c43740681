"""Help that withdraws: for each corner, decided between laps from how the corner was driven.

Drivers follow constant help and forget it: feedback only outside a band kept better in retention
(de Groot et al., Concurrent bandwidth feedback in simulated driving, 2011), and lane keeping was
better only while a visual guide was on (van Leeuwen et al., 2011).
"""

from collections.abc import Container, Iterable
from dataclasses import dataclass, field
from enum import Enum

# After this number of laps inside the band in a row help for a corner is withdrawn, after this
# number outside it returns.
WITHDRAWN_AFTER, RETURNS_AFTER = 3, 2
# What the kart drives by itself says nothing of its driver: such help is withdrawn after this many.
DRIVEN_AFTER = 1


class Help(Enum):
    """What is done for one corner."""

    NONE = 0  # there was no fault yet
    GIVEN = 1
    WITHDRAWN = 2


@dataclass(frozen=True)
class Attention:
    """The help for one corner, and the laps in a row that decide when it changes."""

    help: Help = Help.NONE
    laps: int = 0  # inside the band while help is given, outside it while it is withdrawn


def after_lap(
    now: Attention, *, is_inside: bool, withdrawn_after: int = WITHDRAWN_AFTER
) -> Attention:
    """Return the help for a corner in the next lap. Within a lap it never changes.

    is_inside: the corner was driven without a fault; withdrawn_after: laps of that in a row with
    help, see `DRIVEN_AFTER`.
    """
    if now.help is Help.NONE:
        return now if is_inside else Attention(Help.GIVEN)
    if is_inside is not (now.help is Help.GIVEN):
        return Attention(now.help)
    laps = now.laps + 1
    if now.help is Help.GIVEN:
        return Attention(Help.WITHDRAWN) if laps >= withdrawn_after else Attention(now.help, laps)
    return Attention(Help.GIVEN) if laps >= RETURNS_AFTER else Attention(now.help, laps)


@dataclass
class Fading:
    """The help for all corners of one driver."""

    withdrawn_after: int = WITHDRAWN_AFTER
    _corners: dict[str, Attention] = field(default_factory=dict)

    def take(self, corners: Iterable[str], faulty: Container[str]) -> None:
        """Take a lap. corners: names of those that were driven; faulty: … with a fault."""
        for corner in corners:
            self._corners[corner] = after_lap(
                self._corners.get(corner, Attention()),
                is_inside=corner not in faulty,
                withdrawn_after=self.withdrawn_after,
            )

    def helps(self, corner: str) -> bool:
        """Return whether help is given in a corner in the next lap."""
        return self._corners.get(corner, Attention()).help is Help.GIVEN
