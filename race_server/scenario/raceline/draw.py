"""A picture of the reference limit: four lines over the course, the fastest with its speed.

That with room is left out: it would lie on the fastest.
"""

from pathlib import Path
from typing import Any

import numpy as np

from race_server.errors import TrackError
from race_server.pictures import check_picture, save
from race_server.scenario.raceline.result import Limit, Raceline
from race_server.scenario.track.course import Course
from race_server.scenario.track.draw import draw_on

_OTHERS = (
    ("centre_line", "centre line", "#ffffff", "--"),
    ("shortest", "shortest", "#80deea", "-"),
    ("minimum_curvature", "minimum curvature", "#f8bbd0", "-"),
)


def draw_limit(course: Course, limit: Limit, title: str, path: Path) -> None:
    """Draw four lines of a limit into a file.

    Raises:
        ScenarioError: the file's suffix is neither .png nor .svg.
        TrackError: it cannot be written.
    """
    check_picture(path)
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    size = np.ptp(course.borders.reshape(-1, 2), axis=0)
    height = min(max(8.5 * float(size[1] / size[0]), 3.0), 14.0)
    figure, axes = pyplot.subplots(figsize=(10.5, height + 1.6), layout="constrained")
    draw_on(axes, course)
    for name, words, colour, dashes in _OTHERS:
        line: Raceline = getattr(limit, name)
        axes.plot(
            np.append(line.x, line.x[0]),
            np.append(line.y, line.y[0]),
            color=colour,
            linestyle=dashes,
            linewidth=1.0,
            label=f"{words}   {line.time_s:.2f} s",
            zorder=6,
        )
    speeds = _speed_line(axes, limit.minimum_time)
    figure.colorbar(speeds, ax=axes, label="speed on the line of minimum time [m/s]", shrink=0.7)
    best = f"minimum time   {limit.minimum_time.time_s:.2f} s"
    axes.plot([], [], color="#f89540", linewidth=2.6, label=best)
    axes.set_title(title, loc="left", fontsize=11)
    legend = axes.legend(
        loc="upper center", bbox_to_anchor=(0.5, -0.05), ncols=4, fontsize=8, facecolor="#5b5f66"
    )
    for text in legend.get_texts():
        text.set_color("white")
    try:
        save(figure, path, dpi=140, facecolor="white")
    except OSError as error:
        raise TrackError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        pyplot.close(figure)


def _speed_line(axes: Any, line: Raceline) -> Any:
    from matplotlib.collections import LineCollection

    points = np.stack([line.x, line.y], axis=1)
    pieces = np.stack([points, np.roll(points, -1, axis=0)], axis=1)
    drawn = LineCollection(
        list(pieces), array=line.speed, cmap="plasma", linewidth=2.6, capstyle="round", zorder=7
    )
    # A lap at one constant speed needs a range for the colours.
    fastest = float(line.speed.max())
    drawn.set_clim(min(float(line.speed.min()), fastest - 0.5), fastest)
    axes.add_collection(drawn)
    return drawn
