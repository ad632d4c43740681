"""Where a kart may drive, as it knows that itself: a course, or the area of a car park."""

import math
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


class Fence(Protocol):
    """Where a kart may drive."""

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

    def beyond(self, x: float, y: float) -> float:
        """Return how far outside the kerb a point lies [m], negative inside."""
        dx, dy = x - self.line[:, 0], y - self.line[:, 1]
        nearest = int(np.argmin(dx * dx + dy * dy))
        heading = self.line[nearest, 2]
        offset = dy[nearest] * math.cos(heading) - dx[nearest] * math.sin(heading)
        width = self.half_widths[nearest, 0 if offset > 0.0 else 1]
        return float(abs(offset) - width - self.kerb)

    def heading_at(self, x: float, y: float) -> float:
        """Return the direction of the course at a point [rad]: every kart starts along it."""
        dx, dy = x - self.line[:, 0], y - self.line[:, 1]
        return float(self.line[int(np.argmin(dx * dx + dy * dy)), 2])


@dataclass(frozen=True)
class LotFence:
    """The area of a car park, where a kart starts in any direction."""

    low: tuple[float, float]  # [m] corner with the least x and y
    high: tuple[float, float]  # [m] corner with the greatest

    def beyond(self, x: float, y: float) -> float:
        """Return how far outside the area a point lies [m], negative inside."""
        (x0, y0), (x1, y1) = self.low, self.high
        return max(x0 - x, x - x1, y0 - y, y - y1)

    def heading_at(self, x: float, y: float) -> None:
        """Return None: a receiver with two antennas has to tell."""
        del x, y
