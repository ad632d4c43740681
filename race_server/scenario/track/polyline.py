"""Closed polylines: lengths, resampling, smoothing, distances."""

import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from race_server.scenario.track.course import Floats

# Points are compared with segments in parts: a few arrays of 2 MB, whatever a course is like.
MOST_PAIRS = 1 << 18


def segments_of(points: Floats) -> Floats:
    """Return the sides of a closed polyline, shape (N, 4): x0, y0, x1, y1."""
    return np.hstack([points, np.roll(points, -1, axis=0)])


def corners_of_box(x: float, y: float, heading: float, length: float, width: float) -> Floats:
    """Return the corners of a box, shape (4, 2) [m], counter-clockwise from the front left one."""
    cos, sin = math.cos(heading), math.sin(heading)
    u, v = 0.5 * length, 0.5 * width
    corners = np.array([(u, v), (-u, v), (-u, -v), (u, -v)])
    return np.asarray(corners @ np.array([[cos, sin], [-sin, cos]]) + np.array([x, y]))


def loops_of(segments: Floats) -> list[Floats]:
    """Return the runs of segments in which each begins where the last ended."""
    jumps = np.abs(segments[1:, :2] - segments[:-1, 2:]).max(axis=1, initial=0.0)
    return list(np.split(segments, np.flatnonzero(jumps > 1e-9) + 1))


def lengths_of(points: Floats) -> Floats:
    """Return the length of each side of a closed polyline, shape (N,)."""
    return np.asarray(np.hypot(*(np.roll(points, -1, axis=0) - points).T))


def resample(points: Floats, count: int) -> Floats:
    """Return `count` points at equal steps along a closed polyline, the first one kept."""
    closed = np.vstack([points, points[:1]])
    at = np.concatenate([[0.0], np.cumsum(lengths_of(points))])
    wanted = np.linspace(0.0, at[-1], count, endpoint=False)
    return np.stack([np.interp(wanted, at, closed[:, axis]) for axis in (0, 1)], axis=1)


def smooth(points: Floats, samples: float) -> Floats:
    """Return a closed curve smoothed by a Gaussian of `samples` standard deviation."""
    count = len(points)
    frequency = np.fft.rfftfreq(count)
    damping = np.exp(-0.5 * (2.0 * np.pi * frequency * samples) ** 2)
    spectrum = np.fft.rfft(points, axis=0) * (damping if points.ndim == 1 else damping[:, None])
    return np.asarray(np.fft.irfft(spectrum, count, axis=0))


def derivatives(points: Floats) -> tuple[Floats, Floats]:
    """Return heading [rad] in [-pi, pi) and curvature [1/m] of a closed curve at equal steps.

    Derivatives are taken by Fourier series: exact for band-limited curves.
    """
    count = len(points)
    wave = 2j * np.pi * np.fft.rfftfreq(count) * count
    if count % 2 == 0:
        wave[-1] = 0.0
    spectrum = np.fft.rfft(points, axis=0)
    first = np.fft.irfft(spectrum * wave[:, None], count, axis=0)
    second = np.fft.irfft(spectrum * wave[:, None] ** 2, count, axis=0)
    speed = np.hypot(*first.T)
    heading = np.arctan2(first[:, 1], first[:, 0])
    heading = np.where(heading >= np.pi, heading - 2.0 * np.pi, heading)
    turn = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    return heading, turn / np.maximum(speed, 1e-9) ** 3


def area_of(points: Floats) -> float:
    """Return the signed area of a closed polyline [m²], positive counter-clockwise."""
    x, y = points.T
    return 0.5 * float(np.sum(x * np.roll(y, -1) - np.roll(x, -1) * y))


def nearest_on(segments: Floats, points: Floats) -> tuple[Floats, Floats]:
    """Return distance (N,) and nearest point (N, 2) of each point to a set of segments."""
    start_x, start_y = segments[:, 0], segments[:, 1]
    along_x, along_y = segments[:, 2] - start_x, segments[:, 3] - start_y
    squares = np.maximum(along_x**2 + along_y**2, 1e-18)
    distances, nearest = np.empty(len(points)), np.empty((len(points), 2))
    for rows in _parts(len(points), len(segments)):
        part = points[rows]
        x, y = part[:, :1] - start_x, part[:, 1:] - start_y
        share = np.clip((x * along_x + y * along_y) / squares, 0.0, 1.0)
        x -= share * along_x
        y -= share * along_y
        square = x**2 + y**2
        best = (np.arange(len(part)), np.argmin(square, axis=1))
        distances[rows] = np.sqrt(square[best])
        nearest[rows] = part - np.column_stack([x[best], y[best]])
    return distances, nearest


def ranges_to(segments: Floats, points: Floats, ways: Floats) -> Floats:
    """Return how far along its direction each point meets a set of segments, or infinity.

    points, ways: (N, 2), ways of length one.
    """
    along = segments[:, 2:] - segments[:, :2]
    ranges = np.empty(len(points))
    for rows in _parts(len(points), len(segments)):
        offset, way = segments[:, :2] - points[rows, None, :], ways[rows]
        cross = way[:, 0, None] * along[:, 1] - way[:, 1, None] * along[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (offset[:, :, 0] * way[:, 1, None] - offset[:, :, 1] * way[:, 0, None]) / cross
            ahead = (offset[:, :, 0] * along[:, 1] - offset[:, :, 1] * along[:, 0]) / cross
        met = (share >= 0.0) & (share <= 1.0) & (ahead >= 0.0)
        ranges[rows] = np.min(np.where(met, ahead, np.inf), axis=1)
    return ranges


def _parts(points: int, segments: int) -> Iterator[slice]:
    """Yield slices of points, each of a bounded number of pairs with segments."""
    step = max(MOST_PAIRS // max(segments, 1), 1)
    for first in range(0, points, step):
        yield slice(first, first + step)


def is_inside(points: Floats, segments: Floats) -> NDArray[np.bool_]:
    """Return whether each point lies inside a closed loop of segments."""
    x, y = points[:, 0, None], points[:, 1, None]
    x0, y0, x1, y1 = segments.T
    rises = (y0 > y) != (y1 > y)
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
    return np.asarray(np.sum(rises & (x < crossing), axis=1) % 2 == 1)


def crossings(segments: Floats, *, first_only: bool = False) -> NDArray[np.int64]:
    """Return pairs of segments that cross properly, shape (N, 2); touching ends do not count.

    first_only: leave out those after the first segment that crosses any.
    """
    a, b = segments[:, :2], segments[:, 2:]
    found = []
    for index in range(len(segments)):
        others = np.arange(index + 1, len(segments))
        side_a = _side(a[index], b[index], a[others]) * _side(a[index], b[index], b[others])
        side_b = _side(a[others], b[others], a[index]) * _side(a[others], b[others], b[index])
        hits = others[(side_a < -1e-12) & (side_b < -1e-12)]
        found.append(np.stack([np.full(len(hits), index), hits], axis=1))
        if first_only and len(hits):
            break
    return np.concatenate(found) if found else np.zeros((0, 2), np.int64)


def _side(start: Floats, end: Floats, point: Floats) -> Floats:
    along, offset = end - start, point - start
    return np.asarray(along[..., 0] * offset[..., 1] - along[..., 1] * offset[..., 0])
