"""Finished laps with their sectors, put together from events."""

from collections.abc import Iterable
from dataclasses import dataclass

from race_server.core.messages import Cleanness, Event, EventKind


@dataclass(frozen=True, slots=True)
class Lap:
    """A lap that was completed."""

    seat: int
    number: int  # from 1
    time_us: int  # [µs]
    sectors: tuple[int, ...]  # [µs] of each sector, in order
    is_clean: bool
    tick: int = 0  # in which it was completed


class LapLog:
    """The laps of one race. Events go in in order, laps come out."""

    def __init__(self) -> None:
        """Begin with no laps."""
        self.times_us: dict[int, list[int]] = {}  # of each seat, in order
        self._sectors: dict[int, list[int]] = {}  # of each seat since its last lap
        self._laps: dict[int, Lap] = {}  # by sequence of the LAP event

    def begin(self, seats: int) -> None:
        """Forget the last race. seats: how many there are."""
        self.times_us = {seat: [] for seat in range(seats)}
        self._sectors.clear()
        self._laps.clear()

    def add(self, event: Event) -> Lap | None:
        """Record an event; return the lap that it completes, if it does."""
        if event.kind is EventKind.SECTOR:
            self._sectors.setdefault(event.kart, []).append(event.value)
        if event.kind is not EventKind.LAP:
            return None
        sectors = tuple(self._sectors.pop(event.kart, ()))
        is_clean = event.detail == Cleanness.CLEAN
        lap = Lap(event.kart, event.other, event.value, sectors, is_clean, event.tick)
        self.times_us.setdefault(event.kart, []).append(event.value)
        self._laps[event.sequence] = lap
        return lap

    def laps_in(self, events: Iterable[Event]) -> list[Lap]:
        """Return the laps that recorded events have completed, in order."""
        return [self._laps[event.sequence] for event in events if event.kind is EventKind.LAP]
