"""The figures of a reproduction: means over seeds, beside those of the report."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from race_agents.reproductions.plan import Column, Reproduction, Variant
from race_server.competition.proportion import wilson_interval


@dataclass(frozen=True)
class VariantSummary:
    """One row of the table with our figures."""

    row: Variant
    runs: int
    steps: int  # decisions of each run
    means: dict[str, float | None]  # None: no run has such a figure
    spreads: dict[str, float]  # standard deviation over the runs, 0 of a single one
    # Decisions, and the return or the share that parked: mean, least and greatest of the runs.
    curve: tuple[tuple[float, ...], ...]
    figures: tuple[dict[str, float | None], ...]  # of each run
    # Further curves, by what they show: decisions, mean, least and greatest of the runs.
    bands: dict[str, tuple[tuple[float, ...], ...]]

    def number(self, column: Column) -> float | None:
        """Return the mean of a figure, or the percentage of all counts together."""
        if not column.of:
            return self.means.get(column.key)
        part, whole = self._total(column.key), self._total(column.of)
        return 100.0 * part / whole if whole else None

    def spread(self, column: Column) -> float:
        """Return the standard deviation of a figure or a percentage over the runs."""
        if not column.of:
            return self.spreads[column.key]
        runs = [(run[column.key] or 0.0, run[column.of] or 0.0) for run in self.figures]
        shares = [100.0 * part / whole for part, whole in runs if whole]
        return _deviation(shares)

    def bounds(self, column: Column) -> tuple[float, float] | None:
        """Return the bounds of 95 % of a percentage, over the counts of all runs; or None."""
        whole = round(self._total(column.of)) if column.of and column.has_bounds else 0
        if not whole:
            return None
        low, high = wilson_interval(round(self._total(column.key)), whole)
        return 100.0 * low, 100.0 * high

    def margins(self, column: Column) -> tuple[float, float]:
        """Return how far a plot's error bar reaches below and above a figure."""
        bounds, number = self.bounds(column), self.number(column)
        if bounds is None or number is None:
            return self.spread(column), self.spread(column)
        # Of none and of all the bound is the figure, up to rounding.
        return max(number - bounds[0], 0.0), max(bounds[1] - number, 0.0)

    def _total(self, key: str) -> float:
        return sum(run[key] or 0.0 for run in self.figures)


def lines_of(plan: Reproduction, outcomes: Sequence[dict[str, Any]]) -> list[VariantSummary]:
    """Return a summary for each row with results."""
    lines = []
    for row in plan.rows:
        runs = [outcome for outcome in outcomes if outcome["row"] == row.name]
        if runs:
            lines.append(_line(row, runs))
    return lines


def _line(row: Variant, runs: Sequence[dict[str, Any]]) -> VariantSummary:
    means: dict[str, float | None] = {}
    spreads: dict[str, float] = {}
    for key in runs[0]["figures"]:
        found = [run["figures"][key] for run in runs if run["figures"][key] is not None]
        means[key] = float(np.mean(found)) if found else None
        spreads[key] = _deviation(found)
    steps = max(run["steps"] for run in runs)
    curve = _band([run["curve"] for run in runs])
    figures = tuple(run["figures"] for run in runs)
    further = [run.get("curves", {}) for run in runs]
    known = [name for name in further[0] if all(name in of for of in further)]
    bands = {name: _band([of[name] for of in further]) for name in known}
    return VariantSummary(row, len(runs), steps, means, spreads, curve, figures, bands)


def _deviation(values: Sequence[float]) -> float:
    """Return the standard deviation of what a few values are drawn from; 0 of a single one."""
    return float(np.std(values, ddof=1)) if len(values) > 1 else 0.0


def _band(curves: Sequence[Sequence[Sequence[float]]]) -> tuple[tuple[float, ...], ...]:
    """Return decisions, mean, least and greatest value of curves, point by point.

    The ends are aligned; the first episode may end at different steps.
    """
    points = min(map(len, curves))
    if not points:
        return ()
    rows = np.array([curve[-points:] for curve in curves])  # (runs, points, 2)
    at, values = rows[:, :, 0].mean(axis=0), rows[:, :, 1]
    band = zip(at, values.mean(axis=0), values.min(axis=0), values.max(axis=0), strict=True)
    return tuple(tuple(map(float, point)) for point in band)


def remarks_on(plan: Reproduction, lines: Sequence[VariantSummary]) -> list[str]:
    """Return sentences on where our figures agree with the report's, and where they do not."""
    remarks = []
    column = plan.plotted
    numbers = {line.row.name: line.number(column) for line in lines}
    theirs = {
        line.row.name: line.row.their_number for line in lines if line.row.their_number is not None
    }
    both = {name: (theirs[name], ours) for name in theirs if (ours := numbers[name]) is not None}
    if len(both) > 1:
        remarks.append(_orders(plan, both))
    is_higher = plan.better == "higher"
    worse = [name for name, (them, us) in both.items() if (us < them) == is_higher]
    if worse:
        remarks.append(f"Ours are worse than theirs in {column.head}: {'; '.join(worse)}.")
    none = [name for name in numbers if numbers[name] is None]
    if none:
        remarks.append(f"Ours come to no {plan.plotted_word}, so they fail: {'; '.join(none)}.")
    return remarks


def _orders(plan: Reproduction, both: dict[str, tuple[float, float]]) -> str:
    def order(of: int) -> str:
        names = sorted(both, key=lambda name: both[name][of], reverse=plan.better == "higher")
        return ", ".join(names)

    same = "the same" if order(0) == order(1) else "another"
    return f"From best to worst, theirs: {order(0)}; ours: {order(1)} ({same} order)."
