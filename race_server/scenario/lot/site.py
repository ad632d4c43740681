"""A car park as a course: walls around it, no line to drive along."""

from collections.abc import Sequence

import numpy as np

from race_server.scenario.track.course import Course, Floats, Obstacle
from race_server.scenario.track.lot import Lot
from race_server.scenario.track.polyline import area_of, loops_of, segments_of

NO_PLACES = np.zeros((0, 3))


def course_of_lot(
    name: str,
    title: str,
    area: tuple[float, float, float, float],
    obstacles: tuple[Obstacle, ...],
    lot: Lot,
    digest: str,
    polygons: Sequence[Floats] = (),
) -> Course:
    """Return a car park as a course without a line.

    area: x0, x1, y0, y1 [m]; polygons: obstacles by their corners (N, 2) [m], clockwise. They
    become borders, as the area's own.
    """
    x0, x1, y0, y1 = area
    corners = np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)])
    width = min(x1 - x0, y1 - y0)
    return Course(
        name=name,
        title=title,
        spacing=1.0,
        line=np.zeros((0, 4)),
        half_widths=np.zeros((0, 2)),
        kerb=0.0,
        grass=0.0,
        borders=np.concatenate([segments_of(loop) for loop in (corners, *polygons)]),
        gates=np.zeros(0),
        sectors=(),
        grid=NO_PLACES,
        spots=np.zeros((0, 2)),
        obstacles=obstacles,
        starts=np.zeros((0, 6)),
        width_min=width,
        width_mean=width,
        width_max=max(x1 - x0, y1 - y0),
        digest=digest,
        lot=lot,
    )


def area_in(course: Course) -> Floats:
    """Return the four sides of a car park's area: its first borders."""
    return course.borders[:4]


def polygons_in(course: Course) -> list[Floats]:
    """Return the sides of each of a car park's polygons."""
    runs = loops_of(course.borders[4:]) if len(course.borders) > 4 else []
    return [polygon for run in runs for polygon in _parted(run)]


def _parted(run: Floats) -> list[Floats]:
    """Return the polygons of a run of sides: those that begin in one point come in one run."""
    closes = np.flatnonzero(np.abs(run[:, 2:] - run[0, :2]).max(axis=1) <= 1e-9) + 1
    parts = np.split(run, closes[closes < len(run)])
    # What goes round counter-clockwise is a hole, of a polygon that touches itself there.
    return parts if all(area_of(part[:, :2]) < 0.0 for part in parts) else [run]
