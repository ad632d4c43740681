"""The time limit of drivers that run inside this process."""

import signal
import threading
import time
from collections.abc import Iterator

import pytest

from race_server.competition.time_limit import TimeLimitExceeded, time_limit


@pytest.fixture
def no_timer() -> Iterator[None]:
    """Leave the timer of processes to the test, and set it as it was afterwards."""
    handler = signal.getsignal(signal.SIGALRM)
    remaining, interval = signal.setitimer(signal.ITIMER_REAL, 0.0)
    yield
    signal.signal(signal.SIGALRM, handler)
    signal.setitimer(signal.ITIMER_REAL, remaining, interval)


def test_a_driver_cannot_hide_that_it_stalls() -> None:
    def swallow() -> None:
        try:
            time.sleep(60.0)
        except Exception:
            time.sleep(60.0)

    with pytest.raises(TimeLimitExceeded), time_limit(0.05):
        swallow()


def test_a_driver_that_swallows_the_first_alarm_gets_another() -> None:
    def swallow() -> None:
        try:
            time.sleep(60.0)
        except BaseException:
            time.sleep(60.0)

    began = time.monotonic()
    with pytest.raises(TimeLimitExceeded), time_limit(0.05):
        swallow()
    assert time.monotonic() - began < 10.0


def test_somebody_elses_alarm_goes_on_after_ours() -> None:
    before = signal.getitimer(signal.ITIMER_REAL)[0]
    with pytest.raises(TimeLimitExceeded), time_limit(0.05):
        time.sleep(5.0)
    after = signal.getitimer(signal.ITIMER_REAL)[0]
    assert (before > 0.0) == (after > 0.0)
    assert after <= before


def test_an_older_timer_keeps_its_handler_its_end_and_its_interval(no_timer: None) -> None:
    rung: list[int] = []
    signal.signal(signal.SIGALRM, lambda number, _frame: rung.append(number))
    signal.setitimer(signal.ITIMER_REAL, 30.0, 7.0)
    with time_limit(5.0):
        time.sleep(0.2)
    left, interval = signal.getitimer(signal.ITIMER_REAL)
    assert 20.0 < left <= 29.81
    assert interval == 7.0
    signal.raise_signal(signal.SIGALRM)
    assert rung == [signal.SIGALRM]


def test_an_older_timer_that_is_overdue_rings_at_once(no_timer: None) -> None:
    rung = threading.Event()
    signal.signal(signal.SIGALRM, lambda *_: rung.set())
    signal.setitimer(signal.ITIMER_REAL, 0.05)
    with time_limit(5.0):
        time.sleep(0.2)
        assert not rung.is_set()
    assert rung.wait(5.0)


def test_without_an_older_timer_none_runs_afterwards(no_timer: None) -> None:
    with time_limit(5.0):
        assert signal.getitimer(signal.ITIMER_REAL)[0] > 0.0
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_limits_nest_and_the_outer_one_still_ends_its_block(no_timer: None) -> None:
    def nest() -> None:
        with time_limit(20.0):
            time.sleep(0.05)
        time.sleep(30.0)

    began = time.monotonic()
    with pytest.raises(TimeLimitExceeded), time_limit(0.3):
        nest()
    assert time.monotonic() - began < 10.0


def test_a_thread_has_no_limit() -> None:
    done: list[bool] = []

    def work() -> None:
        with time_limit(0.01):
            time.sleep(0.1)
            done.append(True)

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert done == [True]
