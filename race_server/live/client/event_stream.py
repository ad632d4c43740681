"""The events of one race, whichever way they arrive.

A server publishes events as they happen and answers a query with the recent ones, so the two
overlap, and either may come first. The number of an event tells it from the others of its race.
"""

import threading
from bisect import insort
from collections.abc import Iterable

from race_server.core.messages import Event


def _number(event: Event) -> int:
    return event.sequence


class EventStream:
    """Takes events in any order and repeatedly; gives each once, and remembers the newest.

    Methods may be called from any thread.
    """

    def __init__(self, most: int, epoch: int = -1) -> None:
        """Begin with no event. most: events that are remembered; older ones stay known."""
        self._most = most
        self._lock = threading.Lock()
        self.begin(epoch)

    def begin(self, epoch: int) -> None:
        """Forget everything: another race begins."""
        with self._lock:
            self._restart(epoch)

    def _restart(self, epoch: int) -> None:
        self.epoch = epoch
        self._events: list[Event] = []  # by number
        self._numbers: set[int] = set()  # of `_events`
        self._forgotten = -1  # the highest number that is no longer remembered

    def receive(self, epoch: int, events: Iterable[Event]) -> list[Event]:
        """Return those events that were not known yet, in the order in which they happened.

        Another epoch than the last one is another race: what was known is forgotten.
        """
        with self._lock:
            if epoch != self.epoch:
                self._restart(epoch)
            fresh = {event.sequence: event for event in events if self._is_new(event.sequence)}
            for event in fresh.values():
                insort(self._events, event, key=_number)
            self._numbers.update(fresh)
            self._forget()
            return sorted(fresh.values(), key=_number)

    def _is_new(self, number: int) -> bool:
        return number > self._forgotten and number not in self._numbers

    def _forget(self) -> None:
        surplus = len(self._events) - self._most
        if surplus > 0:
            for event in self._events[:surplus]:
                self._numbers.remove(event.sequence)
            self._forgotten = self._events[surplus - 1].sequence
            del self._events[:surplus]

    def recent(self) -> list[Event]:
        """Return the remembered events, oldest first."""
        with self._lock:
            return list(self._events)
