"""A queue between the loop of a server and a thread that writes to a disk.

The loop hands items over and never waits. Each item has a ticket, which says when all up to that
item is written, or never will be.
"""

import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

# A close waits at most this long for the last items.
CLOSE_S = 10.0

Item = TypeVar("Item")


class Progress(Protocol):
    """How far a thread has got with what was handed over."""

    def is_settled(self, number: int) -> bool:
        """Return whether all items up to a number are written, or never will be."""

    def wait(self, number: int, timeout_s: float) -> bool:
        """Wait until they are; False if they are not by the timeout."""


@dataclass(frozen=True, slots=True)
class Ticket:
    """All that was handed over up to one item."""

    progress: Progress
    number: int  # of the item, from 1; 0 where nothing is to be written

    @property
    def is_settled(self) -> bool:
        """Whether all of it is written, or never will be."""
        return self.progress.is_settled(self.number)

    def wait(self, timeout_s: float) -> bool:
        """Wait until it is settled; False if it is not by the timeout."""
        return self.progress.wait(self.number, timeout_s)


class TicketQueue(Generic[Item]):
    """Items that wait for the thread which writes them."""

    def __init__(self, name: str, work: Callable[[], None]) -> None:
        """Prepare the thread that does the `work`; see `start`."""
        self._items: queue.SimpleQueue[Item | None] = queue.SimpleQueue()
        self._taken = 0  # items handed over
        self._settled = 0  # of these, written or given up
        self._is_failing = False
        self._progressed = threading.Condition()
        self._thread = threading.Thread(target=work, name=name, daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    # For the loop: none of these waits but `wait` and `close`

    @property
    def backlog(self) -> int:
        """How many items have been handed over and are not yet settled."""
        return self._taken - self._settled

    @property
    def is_failing(self) -> bool:
        """Whether the thread cannot write now."""
        return self._is_failing

    def put(self, item: Item) -> Ticket:
        """Hand an item over."""
        self._taken += 1
        self._items.put(item)
        return self.newest

    def wake(self, item: Item) -> None:
        """Hand over what only makes the thread do something: it has no ticket."""
        self._items.put(item)

    @property
    def newest(self) -> Ticket:
        """The ticket of all that was handed over so far."""
        return Ticket(self, self._taken)

    @property
    def nothing(self) -> Ticket:
        """A ticket that is settled from the start."""
        return Ticket(self, 0)

    def is_settled(self, number: int) -> bool:
        """Return whether all items up to a number are written, or never will be."""
        return self._settled >= number or self._is_failing

    def wait(self, number: int, timeout_s: float) -> bool:
        """Wait until they are; False if they are not by the timeout."""
        with self._progressed:
            return self._progressed.wait_for(lambda: self.is_settled(number), timeout_s)

    def close(self) -> None:
        """Have the thread write what is left, and wait until it has ended."""
        self._items.put(None)
        self._thread.join(CLOSE_S)

    # For the thread

    def get(self, timeout_s: float | None = None) -> Item | None:
        """Wait for the next item and return it; None after the last.

        Raises:
            Empty: nothing came within the timeout.
        """
        return self._items.get(timeout=timeout_s)

    def is_empty(self) -> bool:
        """Return whether no item waits at this moment."""
        return self._items.empty()

    def settle(self, count: int, *, is_failing: bool = False) -> None:
        """Record that `count` more items are written, or given up for now with `is_failing`."""
        with self._progressed:
            self._settled += count
            self._is_failing = is_failing
            self._progressed.notify_all()
