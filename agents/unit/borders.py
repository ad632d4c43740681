"""The borders of a course as a map: what the radar sees of them tells where the kart is.

Fixes tell the place far better while they are right. Borders hold it where fixes are late, beside,
or none at all.
"""

import math
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.motion import HEADING, Floats, X, Y
from race_agents.unit.safety import Echoes
from race_server.core import codes

CELL = 1.0  # [m]
# An echo farther from every border than this [m] is of something else.
REACH = 4.0
# Echoes of a scan that are used, spread over its field: neighbours tell the same.
MOST_ECHOES = 8
# Deviation [m] of an echo from the border of the map, and as a share of its range: the bearing's.
DEVIATION, BEARING = 0.4, 0.015
# How far off [m] borders are in the middle at least if a kart is not where it is said to be.
ELSEWHERE = 0.6


@dataclass(frozen=True, eq=False)
class Sighting:
    """Borders that a scan shows, and the straight lines on which they lie."""

    ahead: Floats  # (n,) [m] of the rear axle
    left: Floats  # (n,) [m]
    normals: Floats  # (n, 2) of unit length
    offsets: Floats  # (n,) [m] of the lines along their normals
    deviations: Floats  # (n,) [m]

    def residuals(self, state: Floats) -> Floats:
        """Return how far [m] the echoes lie from their lines, seen from a state, (n,)."""
        x, y = _placed(self.ahead, self.left, state)
        return np.asarray(self.offsets - self.normals[:, 0] * x - self.normals[:, 1] * y)

    def belies(self, state: Floats, shift: Floats) -> bool:
        """Return whether the borders lie elsewhere if the kart is `shift` (2,) [m] from a state."""
        here = self.residuals(state)
        there = middle_of(np.abs(here - self.normals.dot(shift)))
        return there > max(ELSEWHERE, 2.0 * middle_of(np.abs(here)))

    def rows(self, state: Floats) -> Floats:
        """Return the derivatives by place and heading of what `residuals` takes off, (n, 3)."""
        cos, sin = math.cos(state[HEADING]), math.sin(state[HEADING])
        turned = self.normals[:, 1] * (self.ahead * cos - self.left * sin)
        turned -= self.normals[:, 0] * (self.ahead * sin + self.left * cos)
        return np.column_stack([self.normals, turned])


@dataclass(frozen=True, eq=False)
class Borders:
    """Pieces of borders, and for each cell of a grid the nearest one."""

    normals: Floats  # (S, 2)
    offsets: Floats  # (S,) [m]
    low: Floats  # (2,) [m] corner of the grid
    nearest: NDArray[np.int32]  # (rows, columns), -1 where none is near

    @classmethod
    def of(cls, segments: Floats) -> Self:
        """Return the map of segments (S, 4), x0, y0, x1, y1 [m]."""
        starts, ways = segments[:, :2], segments[:, 2:] - segments[:, :2]
        lengths = np.hypot(*ways.T)
        kept = lengths > 0.0
        starts, ways, lengths = starts[kept], ways[kept], lengths[kept]
        normals = np.column_stack([-ways[:, 1], ways[:, 0]]) / lengths[:, None]
        low = np.minimum(starts, starts + ways).min(axis=0) - REACH - CELL
        high = np.maximum(starts, starts + ways).max(axis=0) + REACH + CELL
        columns, rows = np.ceil((high - low) / CELL).astype(int)
        nearest = np.full((rows, columns), -1, np.int32)
        away = np.full((rows, columns), REACH)
        for number, (start, way, length) in enumerate(zip(starts, ways, lengths, strict=True)):
            first = np.minimum(start, start + way) - REACH - low
            last = np.maximum(start, start + way) + REACH - low
            box = tuple(
                slice(max(int(a // CELL), 0), int(b // CELL) + 1)
                for a, b in zip(first[::-1], last[::-1], strict=True)
            )
            dy, dx = (np.arange(part.start, part.stop) + 0.5 for part in box)
            dx, dy = low[0] + CELL * dx - start[0], low[1] + CELL * dy[:, None] - start[1]
            share = np.clip((dx * way[0] + dy * way[1]) / length**2, 0.0, 1.0)
            far = np.hypot(dx - share * way[0], dy - share * way[1])
            nearer = far < away[box]
            away[box][nearer], nearest[box][nearer] = far[nearer], number
        return cls(normals, (normals * starts).sum(axis=1), low, nearest)

    def sighting(self, echoes: "BorderEchoes", state: Floats) -> Sighting | None:
        """Return the borders that echoes are of, if the kart is about where a state says."""
        x, y = _placed(echoes.ahead, echoes.left, state)
        rows, columns = self.nearest.shape
        # The outermost cells are far from all borders.
        row = np.clip((y - self.low[1]) / CELL, 0.0, rows - 1.0).astype(int)
        column = np.clip((x - self.low[0]) / CELL, 0.0, columns - 1.0).astype(int)
        which = self.nearest[row, column]
        ahead, left, deviations = echoes.ahead, echoes.left, echoes.deviations
        kept = which >= 0
        if not kept.all():
            if not kept.any():
                return None
            ahead, left, deviations = ahead[kept], left[kept], deviations[kept]
            which = which[kept]
        return Sighting(ahead, left, self.normals[which], self.offsets[which], deviations)


@dataclass(frozen=True, eq=False)
class BorderEchoes:
    """Those echoes of a scan that are used."""

    ahead: Floats  # (n,) [m] of the rear axle
    left: Floats  # (n,) [m]
    deviations: Floats  # (n,) [m]

    @classmethod
    def of(cls, echoes: Echoes) -> Self | None:
        """Return the echoes of borders in a scan, None where there is none."""
        at = np.flatnonzero(echoes.kinds == codes.BORDER)
        if len(at) == 0:
            return None
        if len(at) > MOST_ECHOES:
            at = at[np.linspace(0, len(at) - 1, MOST_ECHOES).astype(int)]
        ahead, left = echoes.x[at], echoes.y[at]
        return cls(ahead, left, np.hypot(DEVIATION, BEARING * np.hypot(ahead, left)))


def middle_of(numbers: Floats) -> float:
    """Return the median of some numbers (n,), the greater one of two in the middle.

    `np.median` takes ten times as long, and the first time 16 ms.
    """
    return float(np.sort(numbers)[len(numbers) // 2])


def _placed(ahead: Floats, left: Floats, state: Floats) -> tuple[Floats, Floats]:
    """Return the places x and y [m] of echoes, seen from a state."""
    cos, sin = math.cos(state[HEADING]), math.sin(state[HEADING])
    return state[X] + ahead * cos - left * sin, state[Y] + ahead * sin + left * cos
