"""Figures of a trial: statistics of the laps of a driver, and what a reality gap costs."""

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from statistics import fmean, median
from typing import Any

import numpy as np

from race_server.competition.time_trial.gaps import NONE
from race_server.competition.time_trial.lap import TrialLap
from race_server.competition.time_trial.run import Run
from race_server.core.state import Floats

RESAMPLES = 1000
COVERED = 95.0  # % of the bootstrap's figures lie within the interval


@dataclass(frozen=True)
class LimitTime:
    """The shortest possible lap on a course, or why it is unknown."""

    time_s: float | None
    reason: str = ""


@dataclass(frozen=True)
class TrialSummary:
    """One driver on one track with one vehicle under one reality gap, over all seeds.

    Times are of laps from a flying start unless the name of the field says otherwise.
    """

    driver: str
    track: str
    vehicle: str
    gap: str
    seeds: int
    laps_wanted: int
    laps: int  # that were completed and count
    clean_lap_rate: float  # of the laps wanted
    median_lap_s: float | None
    median_low_s: float | None
    median_high_s: float | None
    best_lap_s: float | None
    best_clean_lap_s: float | None
    spread_s: float | None  # interquartile range of the laps
    spread_low_s: float | None
    spread_high_s: float | None
    standing_lap_s: float | None  # median of the first laps from standstill
    total_s: float | None  # median time of all laps of a run that was finished
    limit_s: float | None
    limit_reason: str  # why there is none
    ratio: float | None  # median lap to limit
    best_ratio: float | None
    crashes: int  # contacts with walls
    rescues: int
    off_track_s: float  # a lap
    steering_rate: float | None  # [rad/s]
    jerk: float | None  # [m/s³]
    failed: int  # runs in which the driver raised or stalled
    remark: str

    def as_json(self) -> dict[str, Any]:
        """Return the row, with figures rounded to what is significant."""
        return {name: _rounded(value) for name, value in asdict(self).items()}


def _rounded(value: Any) -> Any:
    return round(value, 6) if isinstance(value, float) else value


def rows_of(runs: Sequence[Run], limits: dict[tuple[str, str], LimitTime]) -> list[TrialSummary]:
    """Return one row for each driver, track, vehicle and gap, in the order of the runs.

    limits: by track and vehicle.
    """
    order = {key: number for number, key in reversed(list(enumerate(map(key_of, runs))))}
    ordered = sorted(runs, key=lambda run: order[key_of(run)])
    return [_row_of(list(group), limits) for _, group in groupby(ordered, key_of)]


def key_of(run: Run) -> tuple[str, str, str, str]:
    """Return the key of the row that a run belongs to."""
    spec = run.spec
    return (spec.track, spec.vehicle, spec.gap.name, spec.driver)


def _row_of(runs: Sequence[Run], limits: dict[tuple[str, str], LimitTime]) -> TrialSummary:
    track, vehicle, gap, driver = key_of(runs[0])
    limit = limits[track, vehicle]
    laps = [lap for run in runs for lap in run.laps]
    flying = [[lap.time_s for lap in run.laps if lap.is_flying] for run in runs]
    times = [time for of_run in flying for time in of_run]
    wanted = sum(run.spec.laps for run in runs)
    middle, spread = intervals([of_run for of_run in flying if of_run])
    middle_lap = median(times) if times else None
    best = min(times, default=None)
    return TrialSummary(
        driver=driver,
        track=track,
        vehicle=vehicle,
        gap=gap,
        seeds=len(runs),
        laps_wanted=wanted,
        laps=len(laps),
        clean_lap_rate=sum(lap.is_clean for lap in laps) / wanted,
        median_lap_s=middle_lap,
        median_low_s=middle[0],
        median_high_s=middle[1],
        best_lap_s=best,
        best_clean_lap_s=min((x.time_s for x in laps if x.is_flying and x.is_clean), default=None),
        spread_s=_spread(np.array(times)) if times else None,
        spread_low_s=spread[0],
        spread_high_s=spread[1],
        standing_lap_s=_median_of([lap.time_s for lap in laps if not lap.is_flying]),
        total_s=_median_of([_total(run.laps) for run in runs if len(run.laps) == run.spec.laps]),
        limit_s=limit.time_s,
        limit_reason=limit.reason,
        ratio=_ratio(middle_lap, limit.time_s),
        best_ratio=_ratio(best, limit.time_s),
        crashes=sum(run.crashes for run in runs),
        rescues=sum(run.rescues for run in runs),
        off_track_s=fmean(lap.off_track_s for lap in laps) if laps else 0.0,
        steering_rate=_median_of([lap.steering_rate for lap in laps]),
        jerk=_median_of([lap.jerk for lap in laps]),
        failed=sum(run.failed for run in runs),
        remark=_remark(runs),
    )


def _total(laps: Sequence[TrialLap]) -> float:
    return sum(lap.time_us for lap in laps) / 1e6


def _median_of(values: Sequence[float]) -> float | None:
    return median(values) if values else None


def _ratio(time_s: float | None, limit_s: float | None) -> float | None:
    return time_s / limit_s if time_s and limit_s else None


def _spread(times: Floats) -> float:
    low, high = np.percentile(times, (25.0, 75.0))
    return float(high - low)


Interval = tuple[float | None, float | None]


def intervals(runs: Sequence[Sequence[float]], seed: int = 0) -> tuple[Interval, Interval]:
    """Return bootstrap intervals of the median and of the spread of all laps.

    Laps of one run resemble each other: first runs are drawn with replacement, then laps of each.
    """
    if sum(len(times) for times in runs) < 2:
        return (None, None), (None, None)
    chance = np.random.default_rng(seed)
    tables = [np.array(times) for times in runs]
    middles, spreads = np.empty(RESAMPLES), np.empty(RESAMPLES)
    for turn in range(RESAMPLES):
        drawn = [tables[index] for index in chance.integers(len(tables), size=len(tables))]
        laps = np.concatenate([chance.choice(times, len(times)) for times in drawn])
        middles[turn], spreads[turn] = np.median(laps), _spread(laps)
    return _within(middles), _within(spreads)


def _within(values: Floats) -> Interval:
    rest = 0.5 * (100.0 - COVERED)
    low, high = np.percentile(values, (rest, 100.0 - rest))
    return float(low), float(high)


def _remark(runs: Sequence[Run]) -> str:
    """Return why runs ended early, each reason once with its seeds."""
    reasons: dict[str, list[int]] = {}
    for run in runs:
        if run.remark:
            reasons.setdefault(run.remark, []).append(run.spec.seed)
    parts = []
    for reason, seeds in reasons.items():
        which = ", ".join(str(seed) for seed in seeds)
        everywhere = len(seeds) == len(runs)
        parts.append(reason if everywhere else f"seed {which}: {reason}")
    return "; ".join(parts)


@dataclass(frozen=True)
class Loss:
    """What a reality gap costs a driver, against the same without it."""

    driver: str
    track: str
    vehicle: str
    gap: str
    median_ratio: float | None  # median lap, with to without
    clean_lap_rate_change: float
    crashes_change: int
    spread_change_s: float | None
    laps_change: int

    def as_json(self) -> dict[str, Any]:
        """Return the row, with figures rounded to what is significant."""
        return {name: _rounded(value) for name, value in asdict(self).items()}


def losses_of(rows: Sequence[TrialSummary]) -> list[Loss]:
    """Return the loss of each row with a gap against the row without one, if that exists."""
    nominal = {(row.driver, row.track, row.vehicle): row for row in rows if row.gap == NONE.name}
    found = []
    for row in rows:
        base = nominal.get((row.driver, row.track, row.vehicle))
        if base is None or row.gap == NONE.name:
            continue
        found.append(
            Loss(
                driver=row.driver,
                track=row.track,
                vehicle=row.vehicle,
                gap=row.gap,
                median_ratio=_ratio(row.median_lap_s, base.median_lap_s),
                clean_lap_rate_change=row.clean_lap_rate - base.clean_lap_rate,
                crashes_change=row.crashes - base.crashes,
                spread_change_s=_difference(row.spread_s, base.spread_s),
                laps_change=row.laps - base.laps,
            )
        )
    return found


def _difference(one: float | None, other: float | None) -> float | None:
    return None if one is None or other is None else one - other
