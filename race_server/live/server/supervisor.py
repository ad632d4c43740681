"""A supervisor that starts a process again when a signal, an exception or its watchdog ends it.

The supervisor has everything loaded and compiled before it forks, so the next process works within
milliseconds. It holds no file, lock or network connection itself.
"""

import contextlib
import ctypes
import os
import signal
import sys
import time
import traceback
from collections.abc import Callable, Collection
from dataclasses import dataclass
from functools import partial

from race_server.live.watchdog import HUNG, HUNG_S
from race_server.terminal import say

# A process that ends sooner than this after its start, this many times in a row, is given up.
QUICK_S = 1.0
MOST_QUICK = 5
# Exceptions of processes that ran for less than this are in a row.
STEADY_S = 60.0
# Exit status of a process that an exception ended: EX_SOFTWARE of sysexits.h.
FAILED = 70
# Ends without a signal after which a process is replaced.
_ENDS = {FAILED: "ended by an exception", HUNG: "ended: its loop hung"}
# What asks a process to end.
_ASKS = (signal.SIGINT, signal.SIGTERM)
_PR_SET_PDEATHSIG = 1  # linux/prctl.h


@dataclass(frozen=True)
class Past:
    """How the processes before this one ended."""

    ended: int = 0  # by a signal, an exception or the watchdog
    failures: int = 0  # the last of these in a row that an exception ended within `STEADY_S`


def supervised(
    work: Callable[[Past], int],
    tell: Callable[[str], None],
    on_end: Callable[[int], None] = lambda _: None,
) -> int:
    """Do the work in a child process and return its exit status.

    A process that a signal, an exception or its watchdog ended is replaced at once, unless it was
    asked to end. A status that the work returns is final. on_end: receives the status of each
    process, negative for a signal.
    """
    quick, past = 0, Past()
    while True:
        begun = time.monotonic()
        # What asks before this process listens is heard then, and does not end it alone.
        heard = signal.pthread_sigmask(signal.SIG_BLOCK, _ASKS)
        child = os.fork()
        if child == 0:
            signal.pthread_sigmask(signal.SIG_SETMASK, heard)
            _work_and_exit(partial(work, past))
        status, asked = _wait_for(child, heard)
        code = os.waitstatus_to_exitcode(status)
        on_end(code)
        if asked or (code >= 0 and code not in _ENDS):
            return max(code, 0)
        lasted_s = time.monotonic() - begun
        has_failed = code == FAILED and lasted_s < STEADY_S
        past = Past(past.ended + 1, past.failures + 1 if has_failed else 0)
        is_quick = lasted_s < (2 * HUNG_S if code == HUNG else QUICK_S)
        quick = quick + 1 if is_quick else 0
        how = _ENDS.get(code) or f"killed by {signal.Signals(-code).name}"
        if quick >= MOST_QUICK:
            tell(f"the server was {how} {quick} times in a row; it is not started again")
            return 1
        tell(f"the server was {how}; starting it again")


def _work_and_exit(work: Callable[[], int]) -> None:
    """Do the work, and end this process whatever happens."""
    end_with(os.getppid())
    code = FAILED
    try:
        code = work()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 2
    except BaseException:
        # Where the log goes the disk may be full, or its reader gone.
        with contextlib.suppress(OSError):
            say(traceback.format_exc(), error=True)
    finally:
        for stream in (sys.stdout, sys.stderr):
            with contextlib.suppress(OSError, ValueError):
                stream.flush()
        os._exit(code)


def _wait_for(child: int, heard: Collection[int]) -> tuple[int, bool]:
    """Return the status of a child that has ended, and whether it had been asked to.

    heard: signals that are blocked as soon as this listens, as they were before.
    """
    asked: list[int] = []

    def pass_on(number: int, _frame: object) -> None:
        # The first signal asks; a process that hangs does not hear it, so the second one ends it.
        os.kill(child, signal.SIGKILL if asked else number)
        asked.append(number)

    before = {number: signal.signal(number, pass_on) for number in _ASKS}
    signal.pthread_sigmask(signal.SIG_SETMASK, heard)
    try:
        _, status = os.waitpid(child, 0)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    return status, bool(asked)


def end_with(parent: int) -> None:
    """Have this process asked to end when its parent dies, where the system can do that."""
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGTERM)
        if os.getppid() != parent:  # it has died in the meantime
            os.kill(os.getpid(), signal.SIGTERM)
