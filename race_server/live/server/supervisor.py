"""A supervisor that starts a process again when a signal kills it, or its watchdog ends it.

The supervisor has everything loaded and compiled before it forks, so the next process works within
milliseconds. It holds no file, lock or network connection itself.
"""

import ctypes
import os
import signal
import sys
import time
from collections.abc import Callable
from functools import partial

from race_server.live.watchdog import HUNG, HUNG_S

# A process that is killed sooner than this after its start, this many times in a row, is given up.
QUICK_S = 1.0
MOST_QUICK = 5
_PR_SET_PDEATHSIG = 1  # linux/prctl.h


def supervised(
    work: Callable[[int], int],
    say: Callable[[str], None],
    on_end: Callable[[int], None] = lambda _: None,
) -> int:
    """Do the work in a child process and return its exit status.

    work: receives how often the process was killed so far. A process that is killed by a signal, or
    ended by its watchdog, is replaced at once, unless it was asked to end. on_end: receives the
    status of each, negative for a signal.
    """
    quick = killed = 0
    while True:
        begun = time.monotonic()
        child = os.fork()
        if child == 0:
            _work_and_exit(partial(work, killed))
        status, asked = _wait_for(child)
        code = os.waitstatus_to_exitcode(status)
        on_end(code)
        if asked or (code >= 0 and code != HUNG):
            return max(code, 0)
        killed += 1
        is_quick = time.monotonic() - begun < (2 * HUNG_S if code == HUNG else QUICK_S)
        quick = quick + 1 if is_quick else 0
        how = f"killed by {signal.Signals(-code).name}" if code < 0 else "ended: its loop hung"
        if quick >= MOST_QUICK:
            say(f"the server was {how} {quick} times in a row; it is not started again")
            return 1
        say(f"the server was {how}; starting it again")


def _work_and_exit(work: Callable[[], int]) -> None:
    """Do the work, and end this process whatever happens."""
    end_with(os.getppid())
    code = 1
    try:
        code = work()
    except SystemExit as end:
        code = end.code if isinstance(end.code, int) else 1
    except BaseException:
        sys.excepthook(*sys.exc_info())
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)


def _wait_for(child: int) -> tuple[int, bool]:
    """Return the status of a child that has ended, and whether it had been asked to."""
    asked: list[int] = []

    def pass_on(number: int, _frame: object) -> None:
        # The first signal asks; a process that hangs does not hear it, so the second one ends it.
        os.kill(child, signal.SIGKILL if asked else number)
        asked.append(number)

    before = {number: signal.signal(number, pass_on) for number in (signal.SIGINT, signal.SIGTERM)}
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
