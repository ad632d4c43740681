"""A time limit for drivers that run inside this process, so that a slow one stops no other."""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

# The alarm is repeated: a driver that swallows the first exception gets another.
REPEAT_S = 0.1


class TimeLimitExceeded(BaseException):
    """A driver took too long. No `Exception`: a driver that catches all must not hide it."""


@contextmanager
def time_limit(limit_s: float) -> Iterator[None]:
    """Raise `TimeLimitExceeded` in a block that takes longer than `limit_s` [s].

    Interrupts Python and sleep, but not a call into machine code that never returns: the pool of a
    time trial ends a process that is stuck in one. A timer that ran before goes on afterwards, less
    the time of the block. Has no effect outside the main thread, where signals cannot be handled.

    Raises:
        TimeLimitExceeded: from within the block.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    began = time.monotonic()
    handler = signal.signal(signal.SIGALRM, _interrupt)
    remaining_s, interval_s = signal.setitimer(signal.ITIMER_REAL, limit_s, REPEAT_S)
    try:
        try:
            yield
        finally:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
    finally:
        # Also where the alarm came in just before the line above.
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, handler)
        if remaining_s > 0.0:
            left_s = max(remaining_s - (time.monotonic() - began), 1e-3)
            signal.setitimer(signal.ITIMER_REAL, left_s, interval_s)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise TimeLimitExceeded
