"""Random smooth courses: a closed spline with a width that varies along it."""

from dataclasses import dataclass
from random import Random

import numpy as np

from race_server.core.vehicle_presets import KART_60, TT02
from race_server.scenario.track.build import SCALES, periodic_spline
from race_server.scenario.track.course import Floats
from race_server.scenario.track.polyline import derivatives, lengths_of, resample
from race_server.scenario.track.skeleton import draw_path, whole


@dataclass(frozen=True)
class Size:
    """How large the courses of a scale are [m]."""

    cells: tuple[int, int]  # that the path runs round
    gaps: tuple[int, int]  # between the lines of the grid
    unit: float  # of the gaps
    half_width: tuple[float, float]
    least_radius: float  # of the line
    apart: float  # between the borders of two stretches


SIZES = {
    "1/10": Size((6, 9), (6, 9), 0.5, (0.55, 0.85), 1.1 * TT02.turning_radius, 0.2),
    "kart": Size((7, 12), (6, 9), 4.0, (3.0, 4.5), 2.5 * KART_60.turning_radius, 2.0),
}
JITTER = 0.2  # of the distance between two lines of the grid: how far a point may stray
_ROUGHLY = 0.9  # share of the least radius that three points in a row may show
_ROUGH = 6.0  # spacings between the samples of the rough check
NARROWS = 0.2  # share of the half-width by which it varies along a course


def draw_spline(chance: Random, scale: str) -> Floats:
    """Return points of a course, shape (N, 4): x, y, half-widths left and right [m]."""
    size = SIZES[scale]
    while True:
        points = _points(chance, size)
        if is_drivable(points, size, SCALES[scale].spacing):
            return points


def _points(chance: Random, size: Size) -> Floats:
    corners = np.array(draw_path(chance, whole(chance, *size.cells), size.gaps), np.float64)
    after = np.roll(corners, -1, axis=0)
    pitch = sum(size.gaps) / 2.0
    # A side is drawn by its middle; a long one by a point for every two lines of the grid.
    counts = np.maximum(np.round(lengths_of(corners) / (2.0 * pitch)).astype(int), 1)
    places = [
        begin + (step + 0.5) / count * (end - begin)
        for begin, end, count in zip(corners, after, counts, strict=True)
        for step in range(count)
    ]
    middle = _between(chance, *size.half_width)
    rows = []
    for x, y in places:
        stray = [JITTER * pitch * _between(chance, -1.0, 1.0) for _ in range(2)]
        sides = [middle * (1.0 + NARROWS * _between(chance, -1.0, 1.0)) for _ in range(2)]
        rows.append([size.unit * (x + stray[0]), size.unit * (y + stray[1]), *sides])
    return np.array(rows, np.float64).round(3)


def _between(chance: Random, low: float, high: float) -> float:
    return low + chance.random() * (high - low)


def is_drivable(points: Floats, size: Size, spacing: float) -> bool:
    """Return whether the spline through points bends wide enough and keeps off itself."""
    if len(points) < 4:
        return False
    narrowest, widest = float(points[:, 2:].min()), float(points[:, 2:].max())
    # The inner border still needs a bend.
    least = max(size.least_radius, 1.15 * widest)
    if _tightest_circle(points[:, :2]) < _ROUGHLY * least:
        return False  # most are rejected here, before the expensive part
    for step, share in ((_ROUGH * spacing, 0.9), (2.0 * spacing, 1.0)):
        curve = periodic_spline(points, step)
        # Where two points lie close the spline of the widths may swing far beyond them.
        if curve[:, 2:].min() < 0.9 * narrowest or curve[:, 2:].max() > 1.1 * widest:
            return False
        line = resample(curve[:, :2], max(round(lengths_of(curve[:, :2]).sum() / step), 32))
        _, curvature = derivatives(line)
        if np.abs(curvature).max() * least * share > 1.0:
            return False
    return keeps_apart(line, 2.2 * widest + size.apart)


def _tightest_circle(points: Floats) -> float:
    """Return the radius [m] of the smallest circle through three points in a row."""
    before, after = np.roll(points, 1, axis=0), np.roll(points, -1, axis=0)
    sides = [np.hypot(*(a - b).T) for a, b in ((points, before), (after, points), (after, before))]
    (x1, y1), (x2, y2) = (points - before).T, (after - points).T
    twice_area = np.abs(x1 * y2 - y1 * x2)
    return float(np.min(sides[0] * sides[1] * sides[2] / np.maximum(2.0 * twice_area, 1e-9)))


def keeps_apart(line: Floats, apart: float) -> bool:
    """Return whether no two stretches of a closed line come nearer than `apart` [m].

    Places along the line within a half circle of that diameter belong to one stretch.
    """
    step = float(lengths_of(line).mean())
    count = len(line)
    gap = np.hypot(*(line[:, None, :] - line[None, :, :]).transpose(2, 0, 1))
    numbers = np.arange(count)
    along = np.abs(numbers[:, None] - numbers[None, :])
    along = np.minimum(along, count - along) * step
    return bool((gap[along > 0.5 * np.pi * apart] >= apart).all())
