"""Stints: what a kart drives from one stop to the next, and the items that it uses meanwhile."""

from collections import defaultdict
from collections.abc import Iterable
from dataclasses import replace

from race_server.core.messages import Event, EventKind
from race_server.core.stint import MOST_STINTS, Stint

_STOPS = {EventKind.STUCK, EventKind.RESCUED}


class Stints:
    """The stints of all karts in a race; a new one begins where a kart stands or is rescued."""

    def __init__(self) -> None:
        """Begin with karts on the grid."""
        self._all: defaultdict[int, list[Stint]] = defaultdict(lambda: [Stint(1, 0, 0, 0)])

    def of(self, kart: int) -> tuple[Stint, ...]:
        """Return those of a kart so far, oldest first."""
        return tuple(self._all[kart])

    def add(self, events: Iterable[Event]) -> None:
        """Record what has happened."""
        for event in events:
            if event.kind is EventKind.LAP or event.kind is EventKind.USE or event.kind in _STOPS:
                stints = self._all[event.kart]
                stints[-1:] = _after(stints[-1], event)
                del stints[:-MOST_STINTS]


def _after(stint: Stint, event: Event) -> list[Stint]:
    """Return what a stint becomes by an event: it goes on, or another one follows it."""
    if event.kind is EventKind.LAP:
        best_us = min(stint.best_us or event.value, event.value)
        return [replace(stint, laps=stint.laps + 1, best_us=best_us)]
    if event.kind is EventKind.USE:
        return [replace(stint, items=stint.items + 1)]
    follows = stint.laps + stint.items > 0
    return [stint, Stint(stint.first_lap + stint.laps, 0, 0, 0)] if follows else [stint]
