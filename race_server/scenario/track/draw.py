"""Pictures of courses, as PNG or SVG."""

from pathlib import Path
from typing import Any

import numpy as np

from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.polyline import area_of, loops_of
from race_server.scenario.track.sheet import INK, draw_into, draw_obstacles, finish

_GRASS, _ASPHALT, _KERB = "#cfe3c4", "#5b5f66", "#d9534f"
_LEFT, _RIGHT = "#c62828", "#2e7d32"


def draw_course(course: Course, path: Path) -> None:
    """Draw a course into a file.

    Raises:
        TrackError: the file's suffix is neither .png nor .svg, or it cannot be written.
    """
    draw_into(path, course, lambda axes: draw_on(axes, course))


def draw_on(axes: Any, course: Course) -> None:
    """Draw a course on matplotlib axes."""
    left, right = course.edges()
    verge = course.kerb + course.grass
    _fill_between_borders(axes, course, _GRASS if verge > 0.0 else _ASPHALT)
    if course.kerb > 0.0:
        outer_left, outer_right = course.edges(course.kerb)
        _ribbon(axes, outer_left, outer_right, _KERB)
    if verge > 0.0:
        _ribbon(axes, left, right, _ASPHALT)
    middle = np.vstack([course.line[:, :2], course.line[:1, :2]])
    axes.plot(*middle.T, color="white", linewidth=0.7, alpha=0.6, dashes=(6, 6))
    _draw_borders(axes, course)
    _draw_gates(axes, course)
    _draw_places(axes, course)
    draw_obstacles(axes, course.obstacles)
    narrow, wide = course.width_min, course.width_max
    across = f"{narrow:.2f} m" if wide - narrow < 0.01 else f"{narrow:.2f} to {wide:.2f} m"
    finish(axes, f"{course.title}   {course.length:.1f} m, {across} wide")


def _ribbon(axes: Any, left: Floats, right: Floats, colour: str) -> None:
    from matplotlib.collections import PolyCollection

    corners = [left, np.roll(left, -1, axis=0), np.roll(right, -1, axis=0), right]
    axes.add_collection(
        PolyCollection(
            list(np.stack(corners, axis=1)),
            facecolors=colour,
            edgecolors=colour,
            linewidths=0.6,
            zorder=1.5,
        )
    )


def _fill_between_borders(axes: Any, course: Course, colour: str) -> None:
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path as Shape

    points, codes = [], []
    for loop in _loops(course.borders):
        points += [*loop.tolist(), loop[0].tolist()]
        codes += [Shape.MOVETO, *([Shape.LINETO] * (len(loop) - 1)), Shape.CLOSEPOLY]
    axes.add_patch(PathPatch(Shape(points, codes), facecolor=colour, edgecolor="none", zorder=1))


def _loops(borders: Floats) -> list[Floats]:
    """Return the border loops, the largest counter-clockwise, the others clockwise as holes."""
    loops = [loop[:, :2] for loop in loops_of(borders)]
    loops.sort(key=lambda loop: -abs(area_of(loop)))
    turned = [loop if area_of(loop) > 0.0 else loop[::-1] for loop in loops]
    return [turned[0], *(loop[::-1] for loop in turned[1:])]


def _draw_borders(axes: Any, course: Course) -> None:
    from matplotlib.collections import LineCollection

    heading = course.line[:, 2]
    colours = []
    for x0, y0, x1, y1 in course.borders:
        middle = np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1)])
        index = int(np.argmin(np.hypot(*(course.line[:, :2] - middle).T)))
        dx, dy = middle - course.line[index, :2]
        on_left = dy * np.cos(heading[index]) - dx * np.sin(heading[index]) > 0.0
        colours.append(_LEFT if on_left else _RIGHT)
    axes.add_collection(
        LineCollection(
            list(course.borders.reshape(-1, 2, 2)),
            colors=colours,
            linewidths=1.8,
            zorder=3,
            capstyle="round",
        )
    )


def _draw_gates(axes: Any, course: Course) -> None:
    left, right = course.edges()
    ends = {gate for gate in course.sectors if gate != 0}
    for gate, progress in enumerate(course.gates):
        index = round(progress / course.spacing) % len(course.line)
        ends_x = [left[index, 0], right[index, 0]]
        ends_y = [left[index, 1], right[index, 1]]
        if gate == 0:
            axes.plot(ends_x, ends_y, color="white", linewidth=3.0, zorder=4)
            axes.plot(ends_x, ends_y, color=INK, linewidth=3.0, dashes=(1, 1), zorder=4)
            x, y, heading, _ = course.line[(index + 6) % len(course.line)]
            size = 0.6 * course.width_mean
            arrow = {"arrowstyle": "-|>", "color": "white", "lw": 1.6}
            tip = (x + size * np.cos(heading), y + size * np.sin(heading))
            axes.annotate("", tip, (x, y), arrowprops=arrow, zorder=5)
        elif gate in ends:
            axes.plot(ends_x, ends_y, color="#ffd54f", linewidth=1.6, zorder=4)


def _draw_places(axes: Any, course: Course) -> None:
    for x, y, heading in course.grid[:12]:
        across = 0.12 * course.width_mean
        dx, dy = -np.sin(heading) * across, np.cos(heading) * across
        axes.plot([x - dx, x + dx], [y - dy, y + dy], color="white", linewidth=1.2, zorder=4)
    if len(course.spots):
        axes.scatter(
            *course.spots.T, s=22, marker="D", color="#29b6f6", edgecolor="white", zorder=5
        )
