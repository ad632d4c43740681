"""Between a race and its audience: nothing is told before it is kept."""

import time
from collections import deque
from collections.abc import Iterable, Iterator
from typing import Protocol

from race_server.core.messages import Event

# An announcement is held back no longer than this, whatever the disk does.
HOLD_S = 3.0


class Keeps(Protocol):
    """Writes things down in its own time; a ticket stands for all that was handed over."""

    def is_settled(self, ticket: int) -> bool:
        """Return whether all up to a ticket is written, or never will be."""

    def wait(self, ticket: int, timeout_s: float) -> bool:
        """Wait until it is; False if it is not by the timeout."""


Tickets = tuple[tuple[Keeps, int], ...]


class CommitGate:
    """Holds events back, in order, until those who keep them have written them down."""

    def __init__(self) -> None:
        """Hold nothing."""
        self._held: deque[tuple[Tickets, float, list[Event]]] = deque()

    def clear(self) -> None:
        """Forget what is held: another race begins."""
        self._held.clear()

    def hold(self, events: list[Event], tickets: Tickets) -> None:
        """Hold events until their tickets are settled."""
        if events:
            self._held.append((tickets, time.monotonic() + HOLD_S, events))

    def released(self, *, wait: bool) -> Iterator[list[Event]]:
        """Yield, in order, the events that may be told now; with `wait`, all of them."""
        while self._held:
            tickets, deadline, events = self._held[0]
            now = time.monotonic()
            if wait:
                for keeper, ticket in tickets:
                    keeper.wait(ticket, max(deadline - time.monotonic(), 0.0))
            elif now < deadline and not all(k.is_settled(ticket) for k, ticket in tickets):
                return
            self._held.popleft()
            yield events

    def told(self, events: Iterable[Event]) -> list[Event]:
        """Return those of the events that are not held back."""
        first = self._held[0][2][0].sequence if self._held else None
        return [event for event in events if first is None or event.sequence < first]
