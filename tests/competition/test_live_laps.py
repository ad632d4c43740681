"""Laps of a race that is on, from snapshots and events."""

import math

import numpy as np
import pytest

from race_server.competition.live_laps import LiveLaps, SeenLap
from race_server.competition.time_trial.lap import PROGRESS, SPEED, TIME
from race_server.core.messages import Cleanness, Event, EventKind, Flag, KartFlag, Phase, Status
from race_server.net.wire.spectate import HAZARD, KART, SnapshotFrame

# A lap takes 10 s at 10 m/s; the timing line is crossed 2.007 s after the first snapshot.
LENGTH, SPEED_MS, BEFORE = 100.0, 10.0, 79.93


def frame(tick: int, karts: int = 1, flag: Flag = Flag.GREEN, **values: float) -> SnapshotFrame:
    """Return a snapshot of karts that follow each other a second apart."""
    rows = np.zeros(karts, KART)
    rows["seat"], rows["status"], rows["speed"] = range(karts), Status.RACING, SPEED_MS
    along = BEFORE + SPEED_MS * (tick / 60.0 - np.arange(karts))
    rows["progress"], rows["laps"] = along % LENGTH, along // LENGTH
    for name, value in values.items():
        rows[name] = value
    return SnapshotFrame(
        0, 0, tick, 0.0, Phase.RUNNING, flag, rows, np.zeros(0, np.uint8), np.zeros(0, HAZARD)
    )


def lap_event(number: int) -> Event:
    tick = math.floor(60 * (2.007 + 10.0 * (number - 1)))
    return Event(number, tick, EventKind.LAP, 0, number, 10_000_000, Cleanness.CLEAN)


def seen(first: int = 0, blind: range = range(0), **values: float) -> list[SeenLap]:
    """Return what is seen of two laps in 25 s. first, blind: ticks before and without snapshots."""
    laps, found = LiveLaps(LENGTH), []
    laps.hear([lap_event(number) for number in (1, 2, 3)])
    for tick in range(first, 1500):
        if tick not in blind:
            laps.see(frame(tick, **values))
            found += laps.ended()
    return found


def test_a_lap_is_cut_where_the_kart_crosses_the_line_between_two_snapshots() -> None:
    # The lap that had begun before the first snapshot was not seen whole.
    first, second = seen()
    assert [first.number, second.number] == [2, 3]
    assert first.lap.time_us == 10_000_000
    trace = first.lap.trace
    assert trace[TIME, -1] == pytest.approx(10.0)
    assert trace[SPEED] == pytest.approx(10.0)
    # Ten metres for each second from the line on.
    assert trace[PROGRESS] == pytest.approx(10.0 * trace[TIME], abs=1e-3)


def test_a_lap_with_a_break_in_its_snapshots_is_not_looked_at() -> None:
    (only,) = seen(blind=range(500, 530))
    assert only.number == 3
    assert len(seen(blind=range(500, 510))) == 2


def test_a_lap_that_is_told_late_has_the_times_of_its_own_way() -> None:
    # Yellow for two seconds after the line at 12.007 s, which is told three seconds late.
    laps, found = LiveLaps(LENGTH), list[SeenLap]()
    laps.hear([lap_event(1)])
    for tick in range(1500):
        if tick == 900:
            laps.hear([lap_event(2)])
        if tick == 1400:
            laps.hear([lap_event(3)])
        laps.see(frame(tick, flag=Flag.YELLOW if 724 < tick < 844 else Flag.GREEN))
        found += laps.ended()
    assert [lap.reason for lap in found] == ["", "2.0 s under a flag"]


def test_the_last_lap_counts_though_no_snapshot_comes_after_it() -> None:
    laps = LiveLaps(LENGTH)
    laps.hear([lap_event(1)])
    for tick in range(720):  # until 7 ms before the line
        laps.see(frame(tick))
        assert not list(laps.ended())
    laps.hear([lap_event(2)])
    assert not list(laps.ended())
    (last,) = laps.ended(is_over=True)
    assert last.lap.is_flying


def test_karts_that_stand_at_home_and_a_course_without_karts_are_nothing_to_note() -> None:
    laps = LiveLaps(LENGTH)
    assert laps.see(frame(0, karts=0)) == []
    for tick in range(3, 300, 3):
        (glance,) = laps.see(frame(tick, status=Status.FINISHED))
        assert not glance.is_driving
    laps.hear([lap_event(1)])
    assert list(laps.ended(is_over=True)) == []


@pytest.mark.parametrize(
    ("values", "reason"),
    [
        ({}, ""),
        ({"effects": 1.0}, "10.0 s under an item's effect"),
        ({"flag": Flag.YELLOW}, "10.0 s under a flag"),
        ({"flags": KartFlag.YELLOW}, "10.0 s under a flag"),
    ],
)
def test_a_lap_that_says_nothing_of_its_driver_is_not_compared(
    values: dict[str, float], reason: str
) -> None:
    assert [lap.reason for lap in seen(**values)] == [reason, reason]


def test_a_kart_is_glanced_at_with_the_times_to_those_around_it() -> None:
    ahead, behind = LiveLaps(LENGTH).see(frame(0, karts=2))
    assert (ahead.ahead_s, ahead.behind_s) == pytest.approx((9.0, 1.0))
    assert (behind.ahead_s, behind.behind_s) == pytest.approx((1.0, 9.0))
    assert ahead.is_driving
    (turned,) = LiveLaps(LENGTH).see(frame(0, flags=KartFlag.WRONG_WAY))
    assert not turned.is_driving
