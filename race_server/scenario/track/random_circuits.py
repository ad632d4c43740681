"""Random circuits: straights and arcs, from short and narrow to long and wide.

Length, width and the radius of each corner are drawn apart, so that some straights are long enough
for top speed and end in a bend that takes real braking.
"""

import math
from dataclasses import dataclass
from random import Random

import numpy as np

from race_server.core.vehicle_presets import KART_60, TT02
from race_server.scenario.track.build import SCALES, periodic_spline
from race_server.scenario.track.course import Floats
from race_server.scenario.track.polyline import derivatives, lengths_of, resample
from race_server.scenario.track.random_splines import keeps_apart
from race_server.scenario.track.skeleton import draw_path, whole


@dataclass(frozen=True)
class Range:
    """Between what the figures of a circuit are drawn [m], all by their logarithm."""

    length: tuple[float, float]
    half_width: tuple[float, float]
    least_radius: float  # of the centre line
    apart: float  # between the borders of two stretches
    narrowest: float  # half-width anywhere, for the body and the margin of a line on both sides


RANGES = {
    "1/10": Range((20.0, 500.0), (0.4, 2.5), 1.1 * TT02.turning_radius, 0.2, 0.15),
    "kart": Range((250.0, 2000.0), (2.5, 6.0), 1.5 * KART_60.turning_radius, 2.0, 1.0),
}
CELLS, GAPS = (1, 10), (2, 9)
JITTER = 0.25  # of the shortest gap: how far a corner strays from the grid
VARIES = 0.15  # share of the half-width by which it varies from straight to straight
MOST_OF_SIDE = 0.45  # of the shorter side that the arc of a corner takes
ARC_STEP = math.radians(15.0)
# A bend this much wider than the half-width has an inner border that bends, too.
INSIDE = 1.15
# The spline bends a little tighter than the arcs that it is drawn through.
TIGHTER = 0.9
# Between points far apart the spline of the half-widths may fall below the least by this share.
NARROWER = 0.35
# Half-width as a share of the shortest side at most.
WIDEST = 0.3
# Samples of the rough and of the last check that two stretches keep apart.
ROUGHLY, CHECKED = 100, 600


def draw_circuit(chance: Random, scale: str) -> Floats:
    """Return points of a course, shape (N, 4): x, y, half-widths left and right [m]."""
    form = RANGES[scale]
    while True:
        corners = np.array(draw_path(chance, whole(chance, *CELLS), GAPS), np.float64)
        corners += [[_stray(chance), _stray(chance)] for _ in corners]
        corners *= _by_logarithm(chance, *form.length) / lengths_of(corners).sum()
        low, high = form.half_width
        high = min(high, WIDEST * float(lengths_of(corners).min()))
        if high < low:
            continue
        middle = _by_logarithm(chance, low, high)
        widths = [middle * (1.0 + VARIES * (2.0 * chance.random() - 1.0)) for _ in corners]
        least = max(form.least_radius, INSIDE * max(widths))
        points = _rounded(chance, corners, np.array(widths), least)
        if points is None or not keeps_apart(resample(points[:, :2], ROUGHLY), 2.0 * max(widths)):
            continue  # most are rejected here, before the expensive part
        if _is_drivable(points, least, max(widths), scale):
            return points.round(3)


def _by_logarithm(chance: Random, low: float, high: float) -> float:
    return low * (high / low) ** chance.random()


def _stray(chance: Random) -> float:
    return JITTER * GAPS[0] * (2.0 * chance.random() - 1.0)


def _rounded(chance: Random, corners: Floats, widths: Floats, least: float) -> Floats | None:
    """Return a closed polygon with an arc in each corner; None where a corner has no room for one.

    corners: (M, 2) [m]; widths: (M,) half-width [m] of the side behind each corner; least: radius
    [m]. From its ends two more points keep each straight straight.
    """
    sides = lengths_of(corners)
    ways = (np.roll(corners, -1, axis=0) - corners) / sides[:, None]
    rows: list[list[float]] = []
    for place, corner in enumerate(corners):
        before, after = ways[place - 1], ways[place]
        turn = math.atan2(before[0] * after[1] - before[1] * after[0], float(np.dot(before, after)))
        reach = math.tan(0.5 * abs(turn))  # of the arc along a side, in radii
        if reach < 1e-3:
            return None
        most = MOST_OF_SIDE * min(sides[place - 1], sides[place]) / reach
        if most < least:
            return None
        radius = _by_logarithm(chance, least, most)
        steps = max(math.ceil(abs(turn) / ARC_STEP), 2)
        step = radius * abs(turn) / steps
        begin, end = corner - radius * reach * before, corner + radius * reach * after
        left = math.copysign(radius, turn)
        centre = begin + left * np.array([-before[1], before[0]])
        arc = [_turned(begin - centre, turn * n / steps) + centre for n in range(steps + 1)]
        places = [begin - 2.0 * step * before, begin - step * before, *arc]
        places += [end + step * after, end + 2.0 * step * after]
        shares = np.linspace(0.0, 1.0, len(places))
        if radius * reach + 2.0 * step > 0.499 * min(sides[place - 1], sides[place]):
            # No room for straights: the arcs follow each other.
            places, shares = arc, np.linspace(0.0, 1.0, len(arc))
        for (x, y), share in zip(places, shares, strict=True):
            half = float(widths[place - 1] + share * (widths[place] - widths[place - 1]))
            rows.append([float(x), float(y), half, half])
    return np.array(rows)


def _turned(vector: Floats, angle: float) -> Floats:
    cos, sin = math.cos(angle), math.sin(angle)
    return np.array([cos * vector[0] - sin * vector[1], sin * vector[0] + cos * vector[1]])


def _is_drivable(points: Floats, least: float, widest: float, scale: str) -> bool:
    """Return whether the spline through points is wide enough, and bends so, and keeps apart."""
    curve, halves = np.hsplit(periodic_spline(points, 2.0 * SCALES[scale].spacing), 2)
    form = RANGES[scale]
    if halves.min() < max(NARROWER * points[:, 2:].min(), form.narrowest):
        return False
    length = float(lengths_of(curve).sum())
    line = resample(curve, max(round(length / (2.0 * SCALES[scale].spacing)), 32))
    _, curvature = derivatives(line)
    if np.abs(curvature).max() * TIGHTER * least > 1.0:
        return False
    # Fine enough that no half circle falls between two samples.
    count = min(len(line), max(CHECKED, round(length / (0.5 * widest))))
    return keeps_apart(resample(curve, count), 2.0 * INSIDE * widest + form.apart)
