"""The figures of a reproduction: means over seeds, beside those of the report."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from race_agents.reproductions.plan import Column, Reproduction, Variant


@dataclass(frozen=True)
class VariantSummary:
    """One row of the table with our figures."""

    row: Variant
    runs: int
    steps: int  # decisions of each run
    means: dict[str, float | None]  # None: no run has such a figure
    spreads: dict[str, float]  # standard deviation over the runs, 0 of a single one
    curve: tuple[tuple[float, float], ...]  # decisions, return: the mean of the runs

    def number(self, column: Column) -> float | None:
        """Return the mean of a figure."""
        return self.means.get(column.key)


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
        known = [run["figures"][key] for run in runs if run["figures"][key] is not None]
        means[key] = float(np.mean(known)) if known else None
        spreads[key] = float(np.std(known)) if known else 0.0
    points = min(len(run["curve"]) for run in runs)
    # The ends are aligned; the first episode may end at different steps.
    curve = (
        np.mean([run["curve"][-points:] for run in runs], axis=0) if points else np.zeros((0, 2))
    )
    steps = max(run["steps"] for run in runs)
    pairs = tuple((float(at), float(value)) for at, value in curve)
    return VariantSummary(row, len(runs), steps, means, spreads, pairs)


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
