"""Where a kart may drive, as it knows that itself: a course, or the area of a car park."""

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.borders import Borders

Floats = NDArray[np.float64]


class Fence(Protocol):
    """Where a kart may drive."""

    @property
    def borders(self) -> Borders | None:
        """The borders that a radar sees, None where they are not known."""

    def beyond(self, x: float, y: float) -> float:
        """Return how far outside a point lies [m], negative inside."""

    def heading_at(self, x: float, y: float) -> float | None:
        """Return the direction in which a kart starts at a point [rad], None where any is one."""


@dataclass(frozen=True, eq=False)
class CourseFence:
    """The course as the kart may use it: a band around its centre line."""

    line: Floats  # (N, 4) x, y, heading, curvature
    half_widths: Floats  # (N, 2)
    kerb: float
    borders: Borders | None = None

    @classmethod
    def of(cls, line: Floats, half_widths: Floats, kerb: float, borders: Floats) -> Self:
        """Return the fence of a course. borders: (S, 4) x0, y0, x1, y1 [m] of their pieces."""
        return cls(line, half_widths, kerb, Borders.of(borders) if len(borders) else None)

    def beyond(self, x: float, y: float) -> float:
        """Return how far outside the kerb a point lies [m], negative inside."""
        nearest = self._nearest(x, y)
        place_x, place_y, heading, _ = self.line[nearest].tolist()
        offset = (y - place_y) * math.cos(heading) - (x - place_x) * math.sin(heading)
        width = self.half_widths[nearest, 0 if offset > 0.0 else 1]
        return float(abs(offset) - width - self.kerb)

    def heading_at(self, x: float, y: float) -> float:
        """Return the direction of the course at a point [rad]: every kart starts along it."""
        return float(self.line[self._nearest(x, y), 2])

    def _nearest(self, x: float, y: float) -> int:
        """Return the sample of the line that is nearest to a point."""
        columns = self._columns
        dx, dy = x - columns[0], y - columns[1]
        return int(np.argmin(dx * dx + dy * dy))

    @cached_property
    def _columns(self) -> Floats:
        """Both columns of places of the line, each without gaps in memory, shape (2, N)."""
        return np.ascontiguousarray(self.line[:, :2].T)


@dataclass(frozen=True)
class LotFence:
    """The area of a car park, where a kart starts in any direction."""

    low: tuple[float, float]  # [m] corner with the least x and y
    high: tuple[float, float]  # [m] corner with the greatest

    @property
    def borders(self) -> None:
        """None: parked vehicles are not on the map of a car park."""

    def beyond(self, x: float, y: float) -> float:
        """Return how far outside the area a point lies [m], negative inside."""
        (x0, y0), (x1, y1) = self.low, self.high
        return max(x0 - x, x - x1, y0 - y, y - y1)

    def heading_at(self, x: float, y: float) -> None:
        """Return None: a receiver with two antennas has to tell."""
        del x, y
