"""A limit to how long a driver may think, so that one that stalls does not stop the others."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType


class TimeLimitExceeded(BaseException):
    """A driver thought for too long. No `Exception`: a driver that catches all must not hide it."""


@contextmanager
def time_limit(limit_s: float) -> Iterator[None]:
    """Raise `TimeLimitExceeded` in a block that takes longer than `limit_s`.

    It interrupts Python and sleep, not a call into machine code that never returns; the pool ends
    a process that is stuck in one. Outside a main thread there is no limit.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGALRM, _interrupt)
    # Again and again: a driver that swallows the first alarm gets another.
    signal.setitimer(signal.ITIMER_REAL, limit_s, 0.1)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def _interrupt(_number: int, _frame: FrameType | None) -> None:
    raise TimeLimitExceeded
