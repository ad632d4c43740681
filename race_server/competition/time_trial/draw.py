"""A picture of a trial: laps over the track by speed, speed and delta over the distance."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from race_server.competition.time_trial.ghost import delta
from race_server.competition.time_trial.lap import SPEED, X, Y, column_at
from race_server.competition.time_trial.table import seconds_text
from race_server.core.state import Floats
from race_server.errors import TrackError
from race_server.pictures import check_picture, save
from race_server.scenario.track.course import Course
from race_server.scenario.track.draw import draw_on

_COLOURS = ("#1565c0", "#d84315", "#2e7d32", "#6a1b9a", "#00838f", "#ad1457", "#9e9d24", "#5d4037")
_REFERENCE = "#20242a"
_POINTS = 600  # at which laps are compared
_ACROSS = 3  # maps beside each other
_WIDTH = 11.0  # [in]
_LEAST_DELTA = 0.05  # [s] least range of the panel of deltas
_LINE_SHARE = 0.09  # height of a line of text, as a share of a panel


@dataclass(frozen=True, eq=False)
class Drawn:
    """One driver's laps in a picture."""

    label: str
    time_s: float  # of the best lap
    best: Floats  # (C, N) its trace
    others: tuple[Floats, ...] = ()  # traces of the other laps


def draw_trial(
    course: Course,
    title: str,
    laps: Sequence[Drawn],
    reference: tuple[str, Floats] | None,
    path: Path,
) -> None:
    """Draw laps into a file. reference: name and trace to compare them with.

    Without a reference, that is the fastest lap.

    Raises:
        ScenarioError: the file's suffix is neither .png nor .svg.
        TrackError: it cannot be written.
    """
    check_picture(path)
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    fastest = min(laps, key=lambda lap: lap.time_s)
    against = reference or (f"best of {fastest.label}", fastest.best)
    across = min(len(laps), _ACROSS)
    rows = -(-len(laps) // across)
    size = np.ptp(course.borders.reshape(-1, 2), axis=0)
    map_width = _WIDTH / max(across, 1.6)
    heights = [min(map_width * float(size[1] / size[0]), 5.5) + 0.3] * rows + [2.3, 2.0]
    figure = pyplot.figure(figsize=(_WIDTH, sum(heights) + 0.9), layout="constrained")
    grid = figure.add_gridspec(len(heights), across, height_ratios=heights)
    maps = [figure.add_subplot(grid[n // across, n % across]) for n in range(len(laps))]
    # A trial has no items and one place on the grid.
    empty = replace(course, spots=course.spots[:0], grid=course.grid[:1])
    drawn = [
        _draw_map(axes, empty, lap, laps, reference) for axes, lap in zip(maps, laps, strict=True)
    ]
    figure.colorbar(drawn[0], ax=maps, label="speed [m/s]", shrink=0.8, pad=0.01, aspect=30)
    speeds = figure.add_subplot(grid[rows, :])
    deltas = figure.add_subplot(grid[rows + 1, :], sharex=speeds)
    _draw_speeds(speeds, course, laps, reference)
    _draw_deltas(deltas, course, laps, against)
    figure.suptitle(title, x=0.01, ha="left", fontsize=13, color=_REFERENCE)
    try:
        save(figure, path, dpi=150, facecolor="white")
    except OSError as error:
        raise TrackError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        pyplot.close(figure)


def _draw_map(
    axes: Any,
    course: Course,
    lap: Drawn,
    laps: Sequence[Drawn],
    reference: tuple[str, Floats] | None,
) -> Any:
    from matplotlib.collections import LineCollection

    draw_on(axes, course)
    axes.set_xticks([])
    axes.set_yticks([])
    if reference is not None:
        line_x, line_y = reference[1][X], reference[1][Y]
        axes.plot(line_x, line_y, color=_REFERENCE, linewidth=1.0, dashes=(4, 2), zorder=6)
    for other in lap.others:
        axes.plot(other[X], other[Y], color="white", linewidth=0.5, alpha=0.5, zorder=5)
    points = np.stack([lap.best[X], lap.best[Y]], axis=1)
    pieces = np.stack([points[:-1], points[1:]], axis=1)
    mean = 0.5 * (lap.best[SPEED, :-1] + lap.best[SPEED, 1:])
    line = LineCollection(
        list(pieces), array=mean, cmap="plasma", linewidth=2.4, capstyle="round", zorder=7
    )
    speeds = np.concatenate([one.best[SPEED] for one in laps])
    # Laps at one constant speed need a range for the colours.
    highest = float(speeds.max())
    line.set_clim(min(float(speeds.min()), highest - 0.5), highest)
    axes.add_collection(line)
    axes.set_title(f"{lap.label}   {seconds_text(lap.time_s)} s", loc="left", fontsize=10)
    return line


def _colour(number: int) -> str:
    return _COLOURS[number % len(_COLOURS)]


def _places(course: Course) -> Floats:
    return np.linspace(0.0, course.length, _POINTS)


def _draw_speeds(
    axes: Any, course: Course, laps: Sequence[Drawn], reference: tuple[str, Floats] | None
) -> None:
    places = _places(course)
    for number, lap in enumerate(laps):
        for other in lap.others:
            values = column_at(other, SPEED, places)
            axes.plot(places, values, color=_colour(number), linewidth=0.5, alpha=0.3)
        values = column_at(lap.best, SPEED, places)
        axes.plot(places, values, color=_colour(number), linewidth=1.5, label=lap.label)
    if reference is not None:
        name, trace = reference
        values = column_at(trace, SPEED, places)
        axes.plot(places, values, color=_REFERENCE, linewidth=1.1, dashes=(4, 2), label=name)
    axes.set_ylabel("speed [m/s]")
    axes.set_ylim(bottom=0.0)
    axes.legend(
        loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=5, fontsize=8, frameon=False,
        borderaxespad=0.1,
    )  # fmt: skip
    axes.tick_params(labelbottom=False)
    _dress(axes, course)


def _draw_deltas(
    axes: Any, course: Course, laps: Sequence[Drawn], against: tuple[str, Floats]
) -> None:
    name, trace = against
    places = _places(course)
    for number, lap in enumerate(laps):
        for other in lap.others:
            values = delta(other, trace, places)
            axes.plot(places, values, color=_colour(number), linewidth=0.5, alpha=0.3)
        values = delta(lap.best, trace, places)
        axes.plot(places, values, color=_colour(number), linewidth=1.5)
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, -_LEAST_DELTA), max(high, _LEAST_DELTA))
    _write_ends(axes, [float(delta(lap.best, trace, places[-1:])[0]) for lap in laps])
    axes.axhline(0.0, color=_REFERENCE, linewidth=1.1, dashes=(4, 2))
    axes.set_ylabel("behind [s]")
    axes.set_title(f"behind {name}", loc="left", fontsize=8)
    axes.set_xlabel("distance along the centre line [m]")
    _dress(axes, course)


def _write_ends(axes: Any, ends: Sequence[float]) -> None:
    """Write each lap's delta at the line beside it, one above the other where they are close."""
    low, high = axes.get_ylim()
    apart = _LINE_SHARE * (high - low)
    at = -np.inf
    for number in np.argsort(ends, kind="stable"):
        at = max(ends[number], at + apart)
        axes.annotate(
            f"{ends[number]:+.2f}",
            (1.0, at),
            (3, 0),
            xycoords=("axes fraction", "data"),
            textcoords="offset points",
            fontsize=8,
            color=_colour(int(number)),
            va="center",
            annotation_clip=False,
        )


def _dress(axes: Any, course: Course) -> None:
    for gate in course.sectors:
        if gate:
            axes.axvline(course.gates[gate], color="#bbbbbb", linewidth=0.8, zorder=0)
    axes.set_xlim(0.0, course.length)
    axes.grid(axis="y", color="#e6e6e6", linewidth=0.6)
    axes.tick_params(labelsize=8)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
