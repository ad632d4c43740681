"""A sheet to draw a course or a car park on, and what both have in common there."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from race_server.errors import TrackError
from race_server.pictures import check_picture, save
from race_server.scenario.track.course import Course, Floats, Obstacle
from race_server.scenario.track.polyline import corners_of_box

INK = "#20242a"
WIDTH = 9.0  # [inches] of a sheet


def draw_into(path: Path, course: Course, paint: Callable[[Any], None]) -> None:
    """Make a sheet as large as a course, let it be painted, and write it into a file.

    paint: draws on the axes it is given, in metres.

    Raises:
        ScenarioError: the file's suffix is neither .png nor .svg.
        TrackError: it cannot be written.
    """
    check_picture(path)
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    low, high = _box(course)
    height = max(WIDTH * (high[1] - low[1]) / (high[0] - low[0]), 3.0) + 0.6
    figure, axes = pyplot.subplots(figsize=(WIDTH, height))
    paint(axes)
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    try:
        save(figure, path, dpi=140, bbox_inches="tight", facecolor="white")
    except OSError as error:
        raise TrackError(f"{path}: cannot be written: {error.strerror}") from error
    finally:
        pyplot.close(figure)


def _box(course: Course) -> tuple[Floats, Floats]:
    points = course.borders.reshape(-1, 2)
    margin = 0.06 * float((points.max(axis=0) - points.min(axis=0)).max())
    return points.min(axis=0) - margin, points.max(axis=0) + margin


def draw_obstacles(axes: Any, obstacles: Iterable[Obstacle]) -> None:
    """Draw fixed boxes."""
    for one in obstacles:
        box = corners_of_box(one.x, one.y, one.heading, one.length, one.width)
        axes.fill(box[:, 0], box[:, 1], color="#f0ad4e", zorder=4)


def finish(axes: Any, title: str) -> None:
    """Give a drawing its title and its scale: a metre is as long along both axes."""
    axes.set_aspect("equal")
    axes.tick_params(labelsize=7, colors="#888888")
    for spine in axes.spines.values():
        spine.set_visible(False)
    axes.set_title(title, loc="left", fontsize=11, color=INK)
