"""A picture of an exam of laps: shares of clean laps, and lap times beside the limits."""

from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import Any

from race_server.competition.lap_exam import CourseTry, LapRow
from race_server.pictures import save_and_close

_INK, _CLEAN, _SPOILT = "#20242a", "#1565c0", "#d84315"
_WIDTH, _HEIGHT = 11.0, 1.1  # [in]; of a driver
_BAND = 0.3  # half the height of a driver's band of courses


def draw_laps(rows: Sequence[LapRow], tries: Sequence[CourseTry], path: Path) -> None:
    """Draw the drivers below each other: clean laps to the left, each course to the right.

    Raises:
        ScenarioError: the file cannot be written.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    size = (_WIDTH, 1.4 + _HEIGHT * len(rows))
    figure, (shares, times) = pyplot.subplots(
        1, 2, figsize=size, sharey=True, layout="constrained", width_ratios=(1.0, 1.6)
    )
    for place, row in enumerate(rows):
        _draw_share(shares, place, row)
        driven = [one for one in tries if (one.driver, one.gap) == (row.driver, row.gap)]
        _draw_times(times, place, driven)
    names = [row.driver if row.gap == "none" else f"{row.driver}\ngap: {row.gap}" for row in rows]
    shares.set_yticks(range(len(rows)), names)
    shares.set_ylim(len(rows) - 0.5, -0.5)
    shares.set_xlim(0.0, 100.0)
    shares.set_xlabel("clean laps [%], with bounds of 95 %")
    times.set_xlabel("median lap of a course over its limit; red where a lap was not clean")
    times.axvline(1.0, color=_INK, linewidth=1.0, dashes=(4, 2))
    for panel in (shares, times):
        panel.tick_params(labelsize=8)
        for side in ("top", "right"):
            panel.spines[side].set_visible(False)
    save_and_close(figure, path, dpi=150, facecolor="white")


def _draw_share(panel: Any, place: int, row: LapRow) -> None:
    low, high = (100.0 * bound for bound in row.clean_lap_interval)
    share = 100.0 * row.clean_lap_rate
    panel.barh(place, share, height=2.0 * _BAND, color=_CLEAN, alpha=0.35)
    panel.plot([low, high], [place, place], color=_INK, linewidth=1.2)
    panel.annotate(
        f"{share:.1f} %", (share, place), (-4, 6), textcoords="offset points", ha="right"
    )


def _draw_times(panel: Any, place: int, tries: Sequence[CourseTry]) -> None:
    """Draw a dot for each course, spread over the band in the order of the courses."""
    for number, one in enumerate(tries):
        if one.ratios:
            height = place + _BAND * (2.0 * (number + 0.5) / len(tries) - 1.0)
            colour = _CLEAN if one.clean == one.laps_wanted else _SPOILT
            panel.plot(median(one.ratios), height, "o", color=colour, markersize=3.5, alpha=0.8)
