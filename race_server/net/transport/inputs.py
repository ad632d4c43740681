"""Messages of one seat that wait until the server's loop receives them, a bounded number each."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from typing import Any, Protocol

import zenoh

# More messages of a seat push the oldest out. Not one alone: rubbish that comes after an honest
# message must not hide it.
MOST_INPUTS = 8

Subscribe = Callable[[Any], Any]  # with a handler of zenoh; returns the subscriber
Check = Callable[[Any], bytes | None]  # returns the payload of a sample, None for one to drop


class Inputs(Protocol):
    """The newest messages of one seat."""

    def receive(self) -> Iterator[tuple[bytes, int]]:
        """Yield those since the last call, oldest first, and when each arrived.

        The time is in microseconds by `time.monotonic`.
        """

    def close(self) -> None:
        """Receive no more."""


class RingInputs:
    """Messages wait in a ring of zenoh: no Python runs as they arrive.

    So no flood fights the loop for the interpreter. The time of arrival is that of the call.
    """

    def __init__(self, subscribe: Subscribe, check: Check) -> None:
        """Subscribe; messages are checked when they are received."""
        self._check = check
        self._subscriber = subscribe(zenoh.handlers.RingChannel(MOST_INPUTS))

    def receive(self) -> Iterator[tuple[bytes, int]]:
        """Yield the messages since the last call, oldest first."""
        for _ in range(MOST_INPUTS):
            if (sample := self._subscriber.try_recv()) is None:
                return
            if (data := self._check(sample)) is not None:
                yield data, time.monotonic_ns() // 1000

    def close(self) -> None:
        """Receive no more."""
        self._subscriber.undeclare()


class QueuedInputs:
    """Messages are checked and stamped as they arrive, and wake the loop if it waits."""

    def __init__(self, subscribe: Subscribe, check: Check, wake: Callable[[], None]) -> None:
        """Subscribe. wake: called with each message that passes its check."""
        self._waiting: deque[tuple[bytes, int]] = deque(maxlen=MOST_INPUTS)

        def store(sample: zenoh.Sample) -> None:
            if (data := check(sample)) is not None:
                self._waiting.append((data, time.monotonic_ns() // 1000))
                wake()

        self._subscriber = subscribe(store)

    def receive(self) -> Iterator[tuple[bytes, int]]:
        """Yield the messages since the last call, oldest first."""
        for _ in range(len(self._waiting)):
            yield self._waiting.popleft()

    def close(self) -> None:
        """Receive no more."""
        self._subscriber.undeclare()
