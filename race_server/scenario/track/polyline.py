"""Closed polylines: lengths, resampling, smoothing, distances."""

import math
from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from race_server.scenario.track.course import Floats

# Points are compared with segments in parts: a few arrays of 2 MB, whatever a course is like.
MOST_PAIRS = 1 << 18
RUN = 64  # segments or points that are looked at together


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
    """Return `count` points at equal steps along a closed polyline, the first one kept.

    points: (N, 2 or more): x, y [m], and what else changes evenly from one point to the next.
    """
    closed = np.vstack([points, points[:1]])
    at = np.concatenate([[0.0], np.cumsum(lengths_of(points[:, :2]))])
    wanted = np.linspace(0.0, at[-1], count, endpoint=False)
    return np.stack([np.interp(wanted, at, column) for column in closed.T], axis=1)


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
    """Return distance (N,) and nearest point (N, 2) of each point to a set of segments.

    Runs of segments that are further off than another run, as a whole, are left out.
    """
    middles, radii = _circles_around(segments)
    distances, nearest = np.empty(len(points)), np.empty((len(points), 2))
    for first in range(0, len(points), RUN):
        part = points[first : first + RUN]
        off = np.hypot(part[:, :1] - middles[:, 0], part[:, 1:] - middles[:, 1])
        bound = (off + radii).min(axis=1, keepdims=True) * (1.0 + 1e-9) + 1e-9
        near = np.repeat((off - radii <= bound).any(axis=0), RUN)[: len(segments)]
        found = _nearest_of(segments[near], part)
        distances[first : first + RUN], nearest[first : first + RUN] = found
    return distances, nearest


def _circles_around(segments: Floats) -> tuple[Floats, Floats]:
    """Return middle (G, 2) and radius (G,) of a circle around each run of RUN segments."""
    last = np.repeat(segments[-1:], -len(segments) % RUN, axis=0)
    runs = np.vstack([segments, last]).reshape(-1, 2 * RUN, 2)
    middles = 0.5 * (runs.min(axis=1) + runs.max(axis=1))
    return middles, np.hypot(*np.moveaxis(runs - middles[:, None], -1, 0)).max(axis=1)


def _nearest_of(segments: Floats, points: Floats) -> tuple[Floats, Floats]:
    start_x, start_y = segments[:, 0], segments[:, 1]
    along_x, along_y = segments[:, 2] - start_x, segments[:, 3] - start_y
    squares = np.maximum(along_x**2 + along_y**2, 1e-18)
    x, y = points[:, :1] - start_x, points[:, 1:] - start_y
    share = np.clip((x * along_x + y * along_y) / squares, 0.0, 1.0)
    x -= share * along_x
    y -= share * along_y
    square = x**2 + y**2
    best = (np.arange(len(points)), np.argmin(square, axis=1))
    return np.sqrt(square[best]), points - np.column_stack([x[best], y[best]])


def ranges_to(segments: Floats, points: Floats, ways: Floats, most: Floats | float) -> Floats:
    """Return how far along its direction each point meets a set of segments, at most `most` [m].

    points, ways: (N, 2), ways of length one; most: for all points, or (N,). Points that follow one
    another are near to each other, and only segments near to some of them are looked at.
    """
    low = np.minimum(segments[:, :2], segments[:, 2:])
    high = np.maximum(segments[:, :2], segments[:, 2:])
    reach = np.broadcast_to(most, len(points))
    ranges = np.empty(len(points))
    for first in range(0, len(points), RUN):
        rows = slice(first, first + RUN)
        here, far = points[rows], reach[rows].max()
        near = np.all((low <= here.max(axis=0) + far) & (high >= here.min(axis=0) - far), axis=1)
        ranges[rows] = _ranges(segments[near], here, ways[rows])
    return np.minimum(ranges, reach)


def _ranges(segments: Floats, points: Floats, ways: Floats) -> Floats:
    """Return how far along its direction each point meets a set of segments, or infinity."""
    along = segments[:, 2:] - segments[:, :2]
    offset = segments[:, :2] - points[:, None, :]
    cross = ways[:, 0, None] * along[:, 1] - ways[:, 1, None] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        share = (offset[:, :, 0] * ways[:, 1, None] - offset[:, :, 1] * ways[:, 0, None]) / cross
        ahead = (offset[:, :, 0] * along[:, 1] - offset[:, :, 1] * along[:, 0]) / cross
    met = (share >= 0.0) & (share <= 1.0) & (ahead >= 0.0)
    return np.asarray(np.min(np.where(met, ahead, np.inf), axis=1, initial=np.inf))


def _parts(points: int, segments: int) -> Iterator[slice]:
    """Yield slices of points, each of a bounded number of pairs with segments."""
    step = max(MOST_PAIRS // max(segments, 1), 1)
    for first in range(0, points, step):
        yield slice(first, first + step)


def is_inside(points: Floats, segments: Floats) -> NDArray[np.bool_]:
    """Return whether each point lies inside a closed loop of segments."""
    x0, y0, x1, y1 = segments.T
    inside = np.empty(len(points), np.bool_)
    for rows in _parts(len(points), len(segments)):
        x, y = points[rows, 0, None], points[rows, 1, None]
        rises = (y0 > y) != (y1 > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            crossing = x0 + (y - y0) / (y1 - y0) * (x1 - x0)
        inside[rows] = np.sum(rises & (x < crossing), axis=1) % 2 == 1
    return inside


def crossings(segments: Floats, *, first_only: bool = False) -> NDArray[np.int64]:
    """Return pairs of segments that cross properly, shape (N, 2); touching ends do not count.

    Only pairs whose stretches of x overlap are compared. first_only: leave out those after the
    first segment that crosses any.
    """
    low, high = (choose(segments[:, 0], segments[:, 2]) for choose in (np.minimum, np.maximum))
    order = np.argsort(low, kind="stable")
    # In this order segment n is compared with those behind it, as far as `ends[n]`.
    ends = np.searchsorted(low[order], high[order], side="right")
    counts = ends - np.arange(1, len(segments) + 1)
    parts = np.searchsorted(np.cumsum(counts), np.arange(0, counts.sum(), MOST_PAIRS), "right")
    found = [np.zeros((0, 2), np.int64)]
    for first, last in pairwise([*np.unique(parts).tolist(), len(segments)]):
        here = np.repeat(np.arange(first, last), counts[first:last])
        before = np.cumsum(counts[first:last]) - counts[first:last]
        there = here + 1 + np.arange(len(here)) - np.repeat(before, counts[first:last])
        pairs = np.sort(np.stack([order[here], order[there]], axis=1), axis=1)
        found.append(pairs[_cross(segments[pairs[:, 0]], segments[pairs[:, 1]])])
    pairs = np.concatenate(found)
    pairs = pairs[np.lexsort(pairs.T[::-1])]
    return pairs[pairs[:, 0] == pairs[0, 0]] if first_only and len(pairs) else pairs


def _cross(one: Floats, other: Floats) -> NDArray[np.bool_]:
    """Return whether segments (N, 4) and others (N, 4) cross properly, pair by pair."""
    a, b, c, d = one[:, :2], one[:, 2:], other[:, :2], other[:, 2:]
    across = _side(a, b, c) * _side(a, b, d) < -1e-12
    return np.asarray(across & (_side(c, d, a) * _side(c, d, b) < -1e-12))


def _side(start: Floats, end: Floats, point: Floats) -> Floats:
    along, offset = end - start, point - start
    return np.asarray(along[..., 0] * offset[..., 1] - along[..., 1] * offset[..., 0])
