"""How long a driver that drives inside this process may think."""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager


class TimeLimitExceeded(BaseException):  # no Exception, lest a driver catches it with its own
    """A driver thinks for too long."""


@contextmanager
def time_limit(seconds: float) -> Iterator[None]:
    """Interrupt Python code of the block after `seconds`; only in the main thread.

    Raises:
        OutOfTime: from within the block.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def ring(_number: int, _frame: object) -> None:
        raise TimeLimitExceeded

    began = time.monotonic()
    handler = signal.signal(signal.SIGALRM, ring)
    remaining, interval = signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        # Somebody else's alarm goes on as if we had not been there.
        left = max(remaining - (time.monotonic() - began), 1e-3) if remaining > 0.0 else 0.0
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, handler)
        signal.setitimer(signal.ITIMER_REAL, left, interval)
