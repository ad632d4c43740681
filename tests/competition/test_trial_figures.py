"""Laps of a trial out of its samples, and the figures of a driver."""

from typing import Any

import numpy as np
import pytest

from race_server.competition.time_trial.figures import (
    LimitTime,
    intervals,
    losses_of,
    rows_of,
)
from race_server.competition.time_trial.gaps import GAPS, NONE, Gap
from race_server.competition.time_trial.ghost import delta
from race_server.competition.time_trial.lap import (
    BRAKE,
    PROGRESS,
    TIME,
    Mark,
    TrialLap,
    laps_of,
    time_at,
)
from race_server.competition.time_trial.limits import limits_of, trace_of_line
from race_server.competition.time_trial.run import Run
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.core.clock import MICROSECONDS
from race_server.scenario.track.load import load_course
from support.trials import PLACE

# Laps out of notes


def test_laps_are_cut_at_the_line_and_interpolated() -> None:
    # 10 m a lap at 2 m/s, a note every 0.5 s from 1 m before the line.
    # The brake is pressed in the half second before the fourth note: from the third on.
    notes = [
        (0.5 * n, (9.0 + n) % 10.0, 9.0 + n, 0.0, 2.0, 0.0, 0.0, float(n == 3), 0.0)
        for n in range(14)
    ]
    marks = [mark(0.5), mark(5.5)]
    (lap,) = laps_of(notes, marks, 10.0, flying=True)
    assert lap.time_s == 5.0
    assert time_at(lap.trace, np.array([0.0, 5.0, 10.0])) == pytest.approx([0.0, 2.5, 5.0])
    assert lap.trace[PROGRESS, lap.trace[BRAKE] == 1.0] == pytest.approx([1.0])


def mark(end_s: float, time_s: float = 5.0) -> Mark:
    return Mark(round(end_s * MICROSECONDS), round(time_s * MICROSECONDS), (), True, 0, 0)


def test_a_slower_lap_falls_behind_where_it_is_slower() -> None:
    even = np.array([(0.0, 5.0, 10.0), (0.0, 5.0, 10.0)])
    late = np.array([(0.0, 5.0, 12.0), (0.0, 5.0, 10.0)])
    assert delta(late, even, np.array([5.0, 7.5, 10.0])) == pytest.approx([0.0, 1.0, 2.0])


def test_the_limit_as_a_lap_takes_its_time() -> None:
    line = limits_of([PLACE]).lines[PLACE]
    trace = trace_of_line(line, load_course("oval").length)
    assert trace[TIME, -1] == pytest.approx(line.time_s)
    assert (np.diff(trace[PROGRESS]) > 0.0).all()


# Figures


def a_lap(time_s: float, number: int = 1, *, clean: bool = True) -> TrialLap:
    time_us = round(time_s * MICROSECONDS)
    return TrialLap(number, time_us, (), True, clean, 0, 0, 0.0, 1.0, 1.0, np.zeros((6, 2)))


def a_run(*times: float, gap: Gap = NONE, seed: int = 1, **more: Any) -> Run:
    spec = RunSpec("ann", "oval", gap=gap, seed=seed, laps=4)
    laps = tuple(a_lap(time_s, number) for number, time_s in enumerate(times, 1))
    return Run(spec, laps=laps, **more)


def test_the_ratio_is_the_median_lap_to_the_limit() -> None:
    row = rows_of([a_run(12.0, 11.0, 10.0), a_run(13.0, seed=2)], {PLACE: LimitTime(10.0)})[0]
    assert row.median_lap_s == 11.5
    assert row.best_lap_s == 10.0
    assert (row.ratio, row.best_ratio) == (1.15, 1.0)


def test_laps_that_were_not_driven_are_not_clean() -> None:
    row = rows_of([a_run(10.0, 10.0, 10.0)], {PLACE: LimitTime(10.0)})[0]
    assert (row.laps, row.laps_wanted, row.clean_lap_rate) == (3, 4, 0.75)


def test_without_a_limit_the_ratio_is_empty_and_says_why() -> None:
    row = rows_of([a_run(10.0)], {PLACE: LimitTime(None, "no line fits")})[0]
    assert row.ratio is None
    assert row.limit_reason == "no line fits"


def test_a_driver_without_a_lap_has_a_row_with_its_remark() -> None:
    row = rows_of([a_run(remark="raised ValueError", failed=True)], {PLACE: LimitTime(10.0)})[0]
    assert (row.median_lap_s, row.ratio, row.laps) == (None, None, 0)
    assert (row.failed, row.remark) == (1, "raised ValueError")


def test_the_bootstrap_interval_covers_the_median_and_repeats() -> None:
    laps = [[10.0, 10.2, 10.4], [10.1, 10.3, 10.5]]
    (low, high), _ = intervals(laps)
    assert low is not None
    assert high is not None
    assert 10.0 <= low < 10.25 < high <= 10.5
    assert intervals(laps) == intervals(laps)


def test_one_lap_has_no_interval() -> None:
    assert intervals([[10.0]]) == ((None, None), (None, None))


def test_a_loss_is_told_against_the_nominal_car() -> None:
    runs = [a_run(10.0, 10.0), a_run(12.0, gap=GAPS["noise"], crashes=3)]
    (loss,) = losses_of(rows_of(runs, {PLACE: LimitTime(None)}))
    assert loss.median_ratio == 1.2
    assert loss.clean_lap_rate_change == -0.25
    assert loss.crashes_change == 3
