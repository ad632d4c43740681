"""A server whose loop hangs: its process ends, another takes its place, without the driver."""

import signal
import subprocess
import sys
import time

import pytest

from race_server.live.local_drivers import LocalDrivers
from race_server.live.suspects import Suspects
from race_server.live.watchdog import Watchdog
from support.sessions import session_on_ring

pytestmark = pytest.mark.live

# The driver of seat 3 never returns, and holds the interpreter lock. Forking wants a process
# without threads.
HANGING = """
import ctypes, sys, time
from race_server.live.server.supervisor import supervised
from race_server.live.watchdog import HUNG, Watchdog
from race_server.live.suspects import Suspects
suspects = Suspects()
def work(_):
    watchdog = Watchdog(0.3)
    watchdog.turn()
    for seat in range(2, 5):
        if not suspects.is_barred(seat):
            with suspects.asking(seat):
                ctypes.PyDLL(None).usleep(900_000 if seat == 3 else 0)
    watchdog.rest()
    time.sleep(0.5)
    print("barred", suspects.barred(), flush=True)
    return 7
judge = lambda code: suspects.judge(is_guilty=code == HUNG)
sys.exit(supervised(work, lambda text: print(text, flush=True), judge))
"""


def test_a_process_that_hangs_is_replaced_by_one_that_asks_the_driver_no_more() -> None:
    done = subprocess.run(
        [sys.executable, "-c", HANGING], capture_output=True, text=True, check=False, timeout=20
    )
    assert done.returncode == 7
    assert done.stdout.splitlines() == [
        "the server was ended: its loop hung; starting it again",
        "barred [3]",
    ]
    assert "in work" in done.stderr  # where it hung


DEAF = """
import signal, sys, time
from race_server.live.server.supervisor import supervised
def work(_):
    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, signal.SIG_IGN)
    print("deaf", flush=True)
    time.sleep(20.0)
    return 0
sys.exit(supervised(work, lambda text: print(text, flush=True)))
"""


def test_the_second_signal_ends_a_process_that_does_not_hear_the_first() -> None:
    command = [sys.executable, "-c", DEAF]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as guard:
        assert guard.stdout is not None
        assert guard.stdout.readline() == "deaf\n"
        guard.send_signal(signal.SIGTERM)
        with pytest.raises(subprocess.TimeoutExpired):
            guard.wait(0.3)
        guard.send_signal(signal.SIGINT)
        assert guard.wait(5.0) == 0
        assert guard.stdout.read() == ""  # it is not started again


def test_only_the_seat_that_was_asked_when_a_process_hung_or_crashed_is_barred() -> None:
    suspects = Suspects()
    with suspects.asking(2):
        pass
    with suspects.asking(3):
        suspects.judge(is_guilty=False)  # killed from outside
        assert suspects.barred() == []
    suspects._marks[3] = 1  # as it stands where a process ends in the middle
    suspects.judge(is_guilty=True)
    assert suspects.barred() == [3]


def test_a_barred_seat_is_not_filled_nor_is_a_closed_one() -> None:
    suspects, session = Suspects(), session_on_ring("cup", karts=4)
    session.seats.close(3, sent_away=False)
    suspects._marks[1] = 1
    suspects.judge(is_guilty=True)
    LocalDrivers(session, suspects).fill(["avoider"])
    assert [seat.is_taken for seat in session.seats] == [True, False, True, False]


def test_a_watchdog_at_rest_does_not_bite_and_one_without_a_limit_never() -> None:
    for watchdog in (Watchdog(0.1), Watchdog()):
        watchdog.turn()
        watchdog.rest()
    time.sleep(0.2)
    assert Watchdog(10.0).outlook == "; after 10 s its process ends"
    assert Watchdog().outlook == ""
