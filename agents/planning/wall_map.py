"""Walls as a lidar sees them: small pieces with a direction, and where a scan fits among them.

A scan is matched point to line (Censi, An ICP variant using a point-to-line metric, 2008), with the
odometry as prior: in a straight corridor the walls do not tell how far a kart has driven.
"""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_server.core.state import Floats

Pose = tuple[float, float, float]  # x, y [m], heading [rad]

# A point's direction comes from its neighbours on both sides; the nearest whose distance is
# CHORD cells. Beyond FLAT cells from their line it lies at a corner.
NEIGHBOURS, CHORD, FLAT = (1, 2, 3, 5, 8), 2.0, 0.25
# Neighbouring ranges that differ by more cells, or by this share, are of different walls.
BREAK, BREAK_SHARE = 2.0, 0.15
# Pieces and points that agree have normals this near [cosine].
ALIKE = 0.75
# Between two straight walls a scan fits everywhere. Of the squares of what its walls face the
# direction that they face least has to have this share.
PLACED = 0.02
ROUNDS = 12
SETTLED = 1e-4
# Standard deviation of a point across its wall [m], and how far off [of them] it stops to count.
NOISE, OUTLYING = 0.02, 3.0
LAYERS = 4


def compose(one: Pose, other: Pose) -> Pose:
    """Return the pose `other`, given in the frame of `one`, in the frame that `one` is given in."""
    cos, sin = math.cos(one[2]), math.sin(one[2])
    x, y = one[0] + cos * other[0] - sin * other[1], one[1] + sin * other[0] + cos * other[1]
    return x, y, one[2] + other[2]


def inverse(pose: Pose) -> Pose:
    """Return the pose of the frame that `pose` is given in, in the frame of `pose`."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    return -cos * pose[0] - sin * pose[1], sin * pose[0] - cos * pose[1], -pose[2]


def placed(points: Floats, pose: Pose, *, turned_only: bool = False) -> Floats:
    """Return points or directions (N, 2) of the frame of a pose in the frame of that pose."""
    cos, sin = math.cos(pose[2]), math.sin(pose[2])
    turned = points @ np.array([[cos, sin], [-sin, cos]])
    return turned if turned_only else turned + np.array(pose[:2])


@dataclass(frozen=True, eq=False)
class Scan:
    """The points of a scan that lie on walls, in the frame of the kart."""

    points: Floats  # (N, 2) [m]
    normals: Floats  # (N, 2) of length one, towards the lidar
    lidar: Floats  # (2,) [m]
    ends: Floats  # (M, 2) [m] of all rays, those that met nothing included

    @property
    def is_placed(self) -> bool:
        """Whether its walls face both ways, so that they tell where it was taken."""
        if len(self.normals) == 0:
            return False
        faced = self.normals.T @ self.normals / len(self.normals)
        return bool(np.linalg.eigvalsh(faced)[0] >= PLACED)


def read_scan(ranges: Floats, field: float, reach: float, mount: float, cell: float) -> Scan:
    """Return the points of a scan whose wall has a direction, and the ends of its rays.

    ranges: (R,) [m], right to left, 0 for a drop-out; field: angle between the outermost rays
    [rad]; mount: of the lidar ahead of the kart's middle [m]; cell: size of a piece of wall [m].
    """
    angles = np.linspace(-0.5 * field, 0.5 * field, len(ranges))
    points = np.column_stack([ranges * np.cos(angles), ranges * np.sin(angles)])
    lidar = np.array([mount, 0.0])
    ends = points[ranges > 0.0] + lidar
    met = (ranges > 0.0) & (ranges < reach - 0.05)
    angles, ranges, points = angles[met], ranges[met], points[met]
    count = len(points)
    if count < 2 * NEIGHBOURS[-1] + 1:
        return Scan(np.zeros((0, 2)), np.zeros((0, 2)), lidar, ends)
    nearer = np.minimum(ranges[1:], ranges[:-1])
    breaks = np.abs(np.diff(ranges)) > np.maximum(BREAK * cell, BREAK_SHARE * nearer)
    breaks |= np.diff(angles) > 4.5 * field / 200.0
    wall = np.concatenate([[0], np.cumsum(breaks)])
    normals, found = np.zeros((count, 2)), np.zeros(count, bool)
    x, y = points.T
    sums = [np.concatenate([[0.0], np.cumsum(part)]) for part in (x, y, x * x, y * y, x * y)]
    index = np.arange(count)
    for reach_out in NEIGHBOURS:
        first, last = index - reach_out, index + reach_out
        fits = (first >= 0) & (last < count) & ~found
        first, last = np.maximum(first, 0), np.minimum(last, count - 1)
        chord = np.hypot(*(points[last] - points[first]).T)
        fits &= (wall[first] == wall[last]) & (chord >= CHORD * cell)
        size = (last - first + 1).astype(float)
        mx, my, xx, yy, xy = ((part[last + 1] - part[first]) / size for part in sums)
        xx, yy, xy = xx - mx * mx, yy - my * my, xy - mx * my
        angle = 0.5 * np.arctan2(2.0 * xy, xx - yy)
        across = np.column_stack([-np.sin(angle), np.cos(angle)])
        spread = 0.5 * (xx + yy) - np.hypot(0.5 * (xx - yy), xy)
        fits &= spread < (FLAT * cell) ** 2
        normals[fits] = across[fits]
        found |= fits
    normals *= np.where(np.sum(normals * points, axis=1) > 0.0, -1.0, 1.0)[:, None]
    return Scan(points[found] + lidar, normals[found], lidar, ends)


@dataclass(frozen=True)
class Fit:
    """Where a scan fits."""

    pose: Pose
    share: float  # of its points that lie on a wall of the map
    error: float  # [m] root mean square of these across their walls


class WallMap:
    """Pieces of wall, at most one in each cell of a grid for each of four directions."""

    def __init__(self, points: Floats, normals: Floats, cell: float) -> None:
        """Average points (N, 2) with their normals (N, 2) in cells of a size [m]."""
        self.cell = cell
        place = np.floor(points / cell).astype(np.int64)
        # Where a lidar met nothing there is no piece, and any corner will do.
        self._corner = (place.min(axis=0) if len(place) else np.zeros(2, np.int64)) - 2
        place -= self._corner
        self._shape = (place.max(axis=0, initial=0) + 3).astype(np.int64)
        layer = np.floor(np.arctan2(normals[:, 1], normals[:, 0]) * (0.5 * LAYERS / math.pi))
        key = (place[:, 0] * self._shape[1] + place[:, 1]) * LAYERS + layer.astype(
            np.int64
        ) % LAYERS
        _, piece, counts = np.unique(key, return_inverse=True, return_counts=True)
        mean = [np.bincount(piece, part) / counts for part in (*points.T, *normals.T)]
        self.points = np.column_stack(mean[:2])
        length = np.hypot(mean[2], mean[3])
        self.normals = np.column_stack(mean[2:]) / np.maximum(length, 1e-9)[:, None]
        self.counts: NDArray[Any] = counts
        self._grid = np.full(int(self._shape.prod()) * LAYERS, -1, np.int64)
        self._grid[key] = piece
        steps = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)])
        around = (steps[:, 0] * self._shape[1] + steps[:, 1]) * LAYERS
        self._around = (around[:, None] + np.arange(LAYERS)).ravel()

    def nearest(self, points: Floats, normals: Floats) -> NDArray[np.int64]:
        """Return the piece nearest to each point whose normal is alike, -1 where there is none."""
        near, inside = self._around_of(points)
        dx = self.points[near, 0] - points[:, :1]
        dy = self.points[near, 1] - points[:, 1:]
        alike = self.normals[near, 0] * normals[:, :1] + self.normals[near, 1] * normals[:, 1:]
        square = np.where((near >= 0) & (alike > ALIKE), dx * dx + dy * dy, np.inf)
        best = np.argmin(square, axis=1)
        row = np.arange(len(points))
        return np.where(inside & np.isfinite(square[row, best]), near[row, best], -1)

    def _around_of(self, points: Floats) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
        """Return the pieces in and beside the cell of each point, and which points are inside."""
        place = np.floor(points / self.cell).astype(np.int64) - self._corner
        inside = np.all((place >= 1) & (place < self._shape - 1), axis=1)
        key = np.where(inside, (place[:, 0] * self._shape[1] + place[:, 1]) * LAYERS, 0)
        near = self._grid[np.clip(key[:, None] + self._around, 0, len(self._grid) - 1)]
        return near, inside

    def is_known(self, points: Floats) -> NDArray[np.bool_]:
        """Return which points (N, 2) have a piece of wall in their cell or beside it."""
        near, inside = self._around_of(points)
        return np.asarray(inside & (near >= 0).any(axis=1))

    def match(self, scan: Scan, guess: Pose, trust: tuple[float, float]) -> Fit:
        """Return where a scan fits, near a guess.

        trust: standard deviations of the guess: of its place [m] and of its heading [rad].
        """
        x, y, heading = guess
        share = error = 0.0
        if len(scan.points) == 0 or len(self.points) == 0:
            return Fit(guess, share, error)
        prior = np.diag([trust[0] ** -2, trust[0] ** -2, trust[1] ** -2])
        for _ in range(ROUNDS):
            at = placed(scan.points, (x, y, heading))
            across = placed(scan.normals, (x, y, heading), turned_only=True)
            piece = self.nearest(at, across)
            met = piece >= 0
            if met.sum() < 6:
                return Fit(guess, 0.0, 0.0)
            n, at = self.normals[piece[met]], at[met]
            off = np.sum(n * (at - self.points[piece[met]]), axis=1)
            weight = 1.0 / (1.0 + (off / (OUTLYING * NOISE)) ** 2) / NOISE**2
            turning = n[:, 1] * (at[:, 0] - x) - n[:, 0] * (at[:, 1] - y)
            slopes = np.column_stack([n, turning])
            left = slopes.T @ (weight[:, None] * slopes) + prior
            moved = np.array([x - guess[0], y - guess[1], heading - guess[2]])
            step = np.linalg.solve(left, -slopes.T @ (weight * off) - prior @ moved)
            x, y, heading = x + step[0], y + step[1], heading + step[2]
            on = np.abs(off) < OUTLYING * NOISE
            share = float(on.sum()) / len(scan.points)
            error = float(np.sqrt(np.mean(off[on] ** 2))) if on.any() else 0.0
            if np.abs(step).max() < SETTLED:
                break
        return Fit((float(x), float(y), float(heading)), share, error)
