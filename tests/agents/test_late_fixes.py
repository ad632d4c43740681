"""Fixes that come late, out of order, together, or while others are taken."""

from dataclasses import replace

import pytest

from race_agents.unit.estimator import Estimator
from race_agents.unit.motion import X
from race_agents.unit.readings import Fix, Readings
from race_agents.unit.safety import Echoes
from race_server.core.vehicle_presets import KART_60

STEP = 0.02  # [s]


def straight(turn: int, fix: Fix | None, acceleration: tuple[float, float] | None) -> Readings:
    return Readings(turn * STEP, 10.0, 0.0, 0.0, acceleration, fix)


def test_a_fix_that_comes_late_counts_as_if_it_had_come_in_time() -> None:
    # East at 10 m/s; each fix is told at once, or 0.2 s later with its stamp.
    states = []
    for late in (0, 10):
        estimator = Estimator(KART_60, Fix(0.0, 0.0, 0.05), 0.0, 0.0)
        for turn in range(1, 121):
            of, fix = turn - late, None
            if of > 0 and of % 10 == 0 and of <= 100:
                fix = Fix(0.2 * of + 0.03, 0.02, 0.05, stamp_s=of * STEP)
            estimator.sense(straight(turn, fix, (0.0, 0.0)))
        states.append(estimator.state)
    assert states[0][X] == pytest.approx(states[1][X], abs=1e-9)
    assert states[0] == pytest.approx(states[1], abs=1e-9)


def test_fixes_that_overtake_each_other_are_put_in_order() -> None:
    states = []
    for order in ((20, 30), (30, 20)):
        estimator = Estimator(KART_60, Fix(0.0, 0.0, 0.05), 0.0, 0.0)
        for turn in range(1, 41):
            fix = None
            if turn in (35, 36):
                of = order[turn - 35]
                fix = Fix(0.2 * of, 0.05, 0.05, stamp_s=of * STEP + 0.007)
            estimator.sense(straight(turn, fix, None))
        states.append(estimator.state)
    assert states[0] == pytest.approx(states[1], abs=1e-9)


def test_a_stamp_older_than_the_past_that_is_kept_tells_nothing() -> None:
    estimator = Estimator(KART_60, Fix(0.0, 0.0, 0.05), 0.0, 0.0)
    for turn in range(1, 101):
        estimator.sense(straight(turn, None, None))
    # At 2.02 s: taken for 0.1 s late, as receivers are, and not for 1.02 s.
    taken = [
        estimator.sense(straight(101, Fix(10.0, 0.0, 0.05, stamp_s=1.0), None)),
        estimator.sense(straight(102, Fix(19.4, 0.0, 0.05, stamp_s=1.02), None)),
    ]
    assert [[believed for _, believed in each] for each in taken] == [[False], [True]]


def with_scan(readings: Readings) -> Readings:
    return replace(readings, echoes=Echoes.nothing())


def test_a_late_fix_that_comes_with_a_scan_is_taken_at_the_next_turn() -> None:
    estimator = Estimator(KART_60, Fix(0.0, 0.0, 0.05), 0.0, 0.0)
    for turn in range(1, 100):
        estimator.sense(straight(turn, None, None))
    fix = Fix(19.0, 0.0, 0.05, stamp_s=1.9)
    assert estimator.sense(with_scan(straight(100, fix, None))) == []
    assert estimator.sense(straight(101, None, None)) == [(fix, True)]
    assert estimator.sense(straight(102, None, None)) == []
    # One that comes while the past is driven again waits until that is done.
    fixes = [Fix(0.2 * turn - 1.0, 0.0, 0.05, stamp_s=0.02 * turn - 0.1) for turn in (103, 104)]
    assert estimator.sense(with_scan(straight(103, fixes[0], None))) == []
    assert estimator.sense(straight(104, fixes[1], None)) == [(fixes[0], True)]
    assert estimator.sense(straight(105, None, None)) == [(fixes[1], True)]


def test_a_fix_far_in_the_past_is_driven_again_in_parts_to_the_same_end() -> None:
    states = []
    for asks in (True, False):
        estimator = Estimator(KART_60, Fix(0.0, 0.0, 0.05), 0.0, 0.0)
        for turn in range(1, 61):
            # In the past when it comes 24 steps late; of now when it comes in time.
            told = turn == (54 if asks else 30)
            fix = Fix(6.05, 0.03, 0.05, stamp_s=30 * STEP) if told else None
            estimator.sense(straight(turn, fix, None))
            if asks and turn >= 54:
                # Of 24 steps a half, then all of the 13 that are left, with the one of the turn.
                assert (estimator.timeline.work > 0) is (turn <= 55)
        states.append(estimator.state)
    assert states[0] == pytest.approx(states[1], abs=1e-9)


@pytest.mark.parametrize("scans", [1, 5, 1000])  # one in this number of turns
@pytest.mark.parametrize("late", [4, 15, 30])  # turns
@pytest.mark.parametrize("every", [1, 2, 5])  # turns
def test_fixes_that_come_while_others_are_taken_count_as_if_they_had_come_in_time(
    scans: int, late: int, every: int
) -> None:
    states = []
    for lag in (0, late):
        estimator, told = Estimator(KART_60, Fix(0.0, 0.0, 0.05), 0.0, 0.0), []
        for turn in range(1, 201):
            of, fix = turn - lag, None
            if 50 < of <= 150 and of % every == 0:
                fix = Fix(0.2 * of + 0.03, 0.02, 0.05, stamp_s=of * STEP)
            readings = straight(turn, fix, (0.0, 0.0))
            told += estimator.sense(with_scan(readings) if turn % scans == 0 else readings)
        assert [believed for _, believed in told] == [True] * (100 // every)
        states.append(estimator.state)
    assert states[0] == pytest.approx(states[1], abs=1e-9)


def test_of_two_fixes_with_one_stamp_each_is_judged_by_itself() -> None:
    estimator = Estimator(KART_60, Fix(0.0, 0.0, 0.05), 0.0, 0.0)
    for turn in range(1, 60):
        estimator.sense(straight(turn, None, None))
    right, wrong = (Fix(11.0, y, 0.05, stamp_s=55 * STEP) for y in (0.0, 30.0))
    assert estimator.sense(straight(60, right, None)) == [(right, True)]
    assert estimator.sense(straight(61, wrong, None)) == [(wrong, False)]
