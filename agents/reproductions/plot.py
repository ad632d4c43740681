"""A reproduction as a picture: learning curves, and the figure that is compared."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from race_agents.reproductions.plan import Reproduction
from race_agents.reproductions.summary import VariantSummary
from race_agents.reproductions.watch import OVER_TIME
from race_server.pictures import save

OURS, THEIRS = "tab:blue", "tab:orange"


def draw(path: Path, plan: Reproduction, lines: Sequence[VariantSummary], words: str) -> None:
    """Draw the curves of learning, and ours beside theirs. words: the amount of training."""
    from matplotlib.figure import Figure

    further = list(dict.fromkeys(name for line in lines for name in line.bands))
    height = 1.5 + max(3.2, 0.5 * len(lines))
    figure = Figure(figsize=(11.0, height + (3.2 if further else 0.0)), layout="constrained")
    top, *below = figure.subfigures(
        1 + bool(further), 1, squeeze=False, height_ratios=[height, 3.2][: 1 + bool(further)]
    ).ravel()
    left, right = top.subplots(1, 2)
    _curves(left, plan, lines)
    _bars(right, plan, lines)
    for plots in (one.subplots(1, len(further), squeeze=False) for one in below):
        for plot, name in zip(plots.ravel(), further, strict=True):
            _bands(plot, name, lines)
    figure.suptitle(f"{plan.title}\n{words}", fontsize=11)
    save(figure, path, dpi=100)


def _curves(plot: Any, plan: Reproduction, lines: Sequence[VariantSummary]) -> None:
    for number, line in enumerate(lines):
        _band(plot, line.curve, number, line.row.name)
    _frame(plot, plan.exam.curve_head)
    if plot.get_legend_handles_labels()[0]:
        plot.legend(frameon=False, fontsize=7)


def _bands(plot: Any, name: str, lines: Sequence[VariantSummary]) -> None:
    """Plot a further curve of all rows: the mean of the runs, and their range."""
    for number, line in enumerate(lines):
        _band(plot, line.bands.get(name, ()), number)
    _frame(plot, name.removesuffix(OVER_TIME))
    if name.endswith(OVER_TIME):
        plot.set_xscale("log")
        plot.xaxis.set_major_formatter("{x:g}")  # powers of ten would be formulas
        plot.set_xlabel("processor time of learning, s")


def _band(plot: Any, band: Sequence[Sequence[float]], number: int, name: str = "") -> None:
    """Plot a curve of one row: the mean of the runs, and their range."""
    if band:
        style = _style(number)
        at, mean, least, greatest = zip(*band, strict=True)
        plot.plot(at, mean, label=name or None, **style)
        plot.fill_between(at, least, greatest, color=style["color"], alpha=0.2, linewidth=0)


def _frame(plot: Any, head: str) -> None:
    plot.set_xlabel("decisions")
    plot.locator_params(axis="x", nbins=5)
    plot.set_ylabel(head)
    plot.grid(alpha=0.3)


def _style(number: int) -> dict[str, Any]:
    """Return how the lines of a row look."""
    import matplotlib

    colours = matplotlib.colormaps["tab20"].colors  # type: ignore[attr-defined]  # untyped there
    style = "-" if number < 10 else "--"
    return {"linestyle": style, "color": colours[(2 * number) % 20], "linewidth": 1}


def _bars(plot: Any, plan: Reproduction, lines: Sequence[VariantSummary]) -> None:
    places = np.arange(len(lines))
    has_theirs = any(line.row.their_number is not None for line in lines)
    height = 0.4 if has_theirs else 0.7
    ours = [line.number(plan.plotted) for line in lines]
    margins = np.transpose([line.margins(plan.plotted) for line in lines])
    at = places - height / 2.0 if has_theirs else places
    widths = [value or 0.0 for value in ours]
    plot.barh(at, widths, height, xerr=margins, color=OURS, label="ours")
    if has_theirs:
        numbers = [line.row.their_number for line in lines]
        widths = [value or 0.0 for value in numbers]
        plot.barh(places + height / 2.0, widths, height, color=THEIRS, label="theirs")
        for place, number in zip(places, numbers, strict=True):
            _say_none(plot, place + height / 2.0, number)
        plot.legend(frameon=False, fontsize=8)
    for place, value in zip(at, ours, strict=True):
        _say_none(plot, place, value)
    plot.set_yticks(places, [line.row.name for line in lines], fontsize=8)
    plot.invert_yaxis()
    plot.set_xlabel(plan.plotted.head)
    plot.grid(alpha=0.3, axis="x")


def _say_none(plot: Any, place: float, value: float | None) -> None:
    if value is None:
        plot.text(0.0, place, " none", va="center", fontsize=8)
