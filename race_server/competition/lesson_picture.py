"""The report of a session as a picture: where time was lost, how fast, and what to try."""

from pathlib import Path
from statistics import fmean
from typing import Any

import numpy as np

from race_server.coaching.lesson import Lesson, Studied
from race_server.core.clock import MICROSECONDS, lap_text
from race_server.core.state import Floats
from race_server.errors import ScenarioError
from race_server.pictures import check_picture, save_and_close

_INK, _PAPER, _ROAD, _EDGE = "#20242a", "#ffffff", "#e9ebee", "#9aa0a8"
_OWN, _LIMIT, _AGAINST_BEST = "#1565c0", "#20242a", "#90a4ae"
_WIDTH, _HEIGHT = 12.0, 11.0  # [in]
# Loss per metre is averaged over this share of the lap.
_CALM_SHARE = 0.012
# From an apex to the name of its corner, on the outer side.
_NAME_POINTS = 16.0
# The colours tell apart what is lost in this share of the lap.
_MOST_SHARE = 0.98


def draw_lesson(lesson: Lesson, path: Path) -> None:
    """Draw the report of a lesson into a file.

    Raises:
        ScenarioError: the file's suffix is neither .png nor .svg, it cannot be written, or no lap
            counts.
    """
    check_picture(path)
    best = lesson.best
    if best is None:
        reasons = "; ".join(f"lap {one.number}: {one.reason}" for one in lesson.laps) or "none"
        raise ScenarioError(f"no lap of {lesson.driver} is to be compared ({reasons})")
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    figure = pyplot.figure(figsize=(_WIDTH, _HEIGHT), layout="constrained")
    grid = figure.add_gridspec(4, 2, height_ratios=(5.0, 2.3, 1.5, 1.6), width_ratios=(1.5, 1.0))
    _draw_map(figure, figure.add_subplot(grid[0, 0]), lesson, best)
    _draw_corners(figure.add_subplot(grid[0, 1]), lesson, best)
    speeds = figure.add_subplot(grid[1, :])
    _draw_speeds(speeds, lesson, best)
    _draw_loss(figure.add_subplot(grid[2, :], sharex=speeds), lesson, best)
    _write_tips(figure.add_subplot(grid[3, :]), lesson)
    figure.suptitle(_title(lesson, best), x=0.01, ha="left", fontsize=12, color=_INK)
    save_and_close(figure, path, dpi=130, facecolor=_PAPER)


def _title(lesson: Lesson, best: Studied) -> str:
    behind = (best.lap.time_us - lesson.limit.time_us) / MICROSECONDS
    count = len(lesson.compared)
    laps = "1 lap" if count == 1 else f"{count} laps"
    return (
        f"{lesson.driver}, {lesson.course.title}, {lesson.vehicle.name}: {laps} compared, "
        f"best {lap_text(best.lap.time_us)}, {behind:+.2f} s on the limit"
    )


def _draw_map(figure: Any, axes: Any, lesson: Lesson, best: Studied) -> None:
    from matplotlib.collections import LineCollection

    course, lap = lesson.course, best.lap
    left, right = (np.vstack([edge, edge[:1]]) for edge in course.edges())
    axes.fill(*np.vstack([left, right[::-1]]).T, facecolor=_ROAD, edgecolor="none")
    for edge in (left, right):
        axes.plot(*edge.T, color=_EDGE, linewidth=0.8)
    points = np.stack([lap.x, lap.y], axis=1)
    lost = _loss_per_metre(lesson, best)
    most = max(float(np.quantile(np.abs(lost), _MOST_SHARE)), 1.0)
    lines = LineCollection(
        list(np.stack([points[:-1], points[1:]], axis=1)),
        array=lost,
        cmap="coolwarm",
        linewidth=3.0,
        clim=(-most, most),
    )
    axes.add_collection(lines)
    for corner in lesson.corners:
        x, y = lap.at(lap.x, corner.apex), lap.at(lap.y, corner.apex)
        bend = np.interp(
            corner.apex % course.length,
            np.arange(len(course.line)) * course.spacing,
            np.unwrap(course.line[:, 2]),
        )
        aside = -corner.side * _NAME_POINTS
        axes.annotate(
            corner.name,
            (x, y),
            (-aside * np.sin(bend), aside * np.cos(bend)),
            textcoords="offset points",
            ha="center",
            va="center",
            fontsize=10,
            weight="bold",
            color=_INK,
        )
        axes.plot([x], [y], "o", color=_INK, markersize=3.5)
    axes.plot(*course.line[0, :2], marker="s", color=_INK, markersize=6)
    axes.annotate(
        "line", course.line[0, :2], (8, 8), textcoords="offset points", fontsize=8, color=_INK
    )
    axes.set_aspect("equal")
    axes.axis("off")
    axes.set_title("best lap: lost on the limit", loc="left", fontsize=10, color=_INK)
    bar = figure.colorbar(lines, ax=axes, shrink=0.7, pad=0.01, aspect=30)
    bar.set_label("lost [ms] per metre", fontsize=8)
    bar.ax.tick_params(labelsize=8)


def _loss_per_metre(lesson: Lesson, best: Studied) -> Floats:
    """Return what the best lap loses (N,) [ms/m] on the limit, averaged."""
    lap, limit = best.lap, lesson.limit
    lost = 1e3 * (np.diff(lap.time) - np.diff(limit.time)) / lap.step
    wide = 2 * (round(_CALM_SHARE * len(lost)) // 2) + 1
    padded = np.concatenate([lost[-(wide // 2) :], lost, lost[: wide // 2]])
    return np.convolve(padded, np.full(wide, 1.0 / wide), mode="valid")


def _draw_corners(axes: Any, lesson: Lesson, best: Studied) -> None:
    names = [corner.name for corner in lesson.corners]
    rows = np.arange(len(names))
    assert best.against_limit is not None
    limit = [one.total_us / 1e3 for one in best.against_limit.corners]
    behind = [one.against_best for one in lesson.compared if one.against_best]
    own = [fmean(loss.corners[row].total_us for loss in behind) / 1e3 for row in rows]
    axes.barh(rows - 0.18, limit, height=0.34, color=_OWN, label="best lap, on the limit")
    axes.barh(rows + 0.2, own, height=0.34, color=_AGAINST_BEST, label="all laps, on the best")
    for row, corner in enumerate(lesson.corners):
        fault = next((one for one in best.faults if one.corner is corner), None)
        if fault:
            axes.annotate(
                fault.words, (max(limit[row], 0.0), row - 0.18), (4, 0), fontsize=8,
                textcoords="offset points", va="center", color=_INK,
            )  # fmt: skip
    axes.set_yticks(rows, names)
    axes.set_ylim(len(rows) - 0.5, -0.6)
    axes.set_xlim(min(0.0, *limit, *own) * 1.1, max(*limit, *own, 1.0) * 1.9)
    axes.axvline(0.0, color=_INK, linewidth=0.8)
    axes.set_xlabel("lost [ms]", fontsize=8)
    axes.set_title("what each corner costs", loc="left", fontsize=10, color=_INK)
    axes.legend(fontsize=8, frameon=False, loc="lower right")
    _dress(axes)


def _draw_speeds(axes: Any, lesson: Lesson, best: Studied) -> None:
    for one in lesson.compared:
        if one is not best:
            axes.plot(one.lap.progress, one.lap.speed, color=_OWN, linewidth=0.6, alpha=0.35)
    axes.plot(best.lap.progress, best.lap.speed, color=_OWN, linewidth=1.6, label="best lap")
    axes.plot(
        lesson.limit.progress, lesson.limit.speed, color=_LIMIT, linewidth=1.0, dashes=(4, 2),
        label="limit" if not lesson.note else "centre line",
    )  # fmt: skip
    axes.set_ylabel("speed [m/s]", fontsize=8)
    axes.set_ylim(bottom=0.0)
    axes.legend(fontsize=8, frameon=False, ncols=2, loc="lower right")
    axes.tick_params(labelbottom=False)
    _mark_corners(axes, lesson)
    _dress(axes)


def _draw_loss(axes: Any, lesson: Lesson, best: Studied) -> None:
    for one in lesson.compared:
        is_best = one is best
        behind = one.lap.time - lesson.limit.time
        axes.plot(
            one.lap.progress, behind, color=_OWN, linewidth=1.6 if is_best else 0.6,
            alpha=1.0 if is_best else 0.35,
        )  # fmt: skip
    axes.set_ylabel("behind [s]", fontsize=8)
    axes.set_xlabel("distance along the centre line [m]", fontsize=8)
    axes.set_xlim(0.0, lesson.course.length)
    _mark_corners(axes, lesson)
    _dress(axes)


def _mark_corners(axes: Any, lesson: Lesson) -> None:
    length = lesson.course.length
    for corner in lesson.corners:
        for shift in (-length, 0.0, length):
            axes.axvspan(
                corner.entry + shift, corner.exit + shift, color=_ROAD, linewidth=0.0, zorder=0
            )
        axes.annotate(
            corner.name, (corner.apex % length, 1.0), (0, -9), fontsize=8, ha="center", color=_INK,
            xycoords=("data", "axes fraction"), textcoords="offset points",
        )  # fmt: skip


def _write_tips(axes: Any, lesson: Lesson) -> None:
    axes.axis("off")
    axes.set_title("what to try", loc="left", fontsize=10, color=_INK)
    lines = [
        f"{number}. {tip.words}   ({tip.cost_us / MICROSECONDS:.2f} s a lap, in {tip.laps} of "
        f"{tip.of} laps)"
        for number, tip in enumerate(lesson.tips, start=1)
    ] or ["nothing: no fault comes back in half of the laps"]
    skipped = [
        f"lap {one.number} is not compared: {one.reason}" for one in lesson.laps if one.reason
    ]
    notes = [*skipped[:2], *([f"and {len(skipped) - 2} more laps"] if len(skipped) > 2 else [])]
    notes += [lesson.note] if lesson.note else []
    for row, words in enumerate(lines):
        axes.annotate(words, (0.0, 0.86 - 0.24 * row), xycoords="axes fraction", fontsize=11,
                      color=_INK, va="top")  # fmt: skip
    for row, words in enumerate(notes):
        axes.annotate(words, (0.0, 0.12 - 0.16 * row), xycoords="axes fraction", fontsize=8,
                      color=_EDGE, va="top")  # fmt: skip


def _dress(axes: Any) -> None:
    axes.tick_params(labelsize=8)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
