"""A course as the rest of the program uses it, for all formats of files."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from race_server.scenario.track.lot import Lot

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Obstacle:
    """A fixed box on the track."""

    x: float  # [m] of its middle
    y: float  # [m]
    heading: float  # [rad]
    length: float  # [m]
    width: float  # [m]


@dataclass(frozen=True, eq=False)
class Course:
    """A closed course. East x, north y; travel along the line is forward; left is positive.

    A car park is a course without a line, whose borders go around it.

    The centre line is sampled at equal steps: sample i lies at progress `i * spacing`, the last
    joins the first, and `length` is `len(line) * spacing`.
    """

    name: str
    title: str
    spacing: float  # [m] between samples of the line
    line: Floats  # (N, 4) x, y [m], heading [rad], curvature [1/m], left positive
    half_widths: Floats  # (N, 2) asphalt to the left and to the right of the line [m]
    kerb: float  # [m] width of the kerb beyond the asphalt, zero where there is none
    grass: float  # [m] width of the grass beyond the kerb; without both, asphalt to the borders
    borders: Floats  # (P, 4) wall segments x0, y0, x1, y1 [m]
    gates: Floats  # (G,) progress [m] of each gate in order; gate 0 is the timing line
    sectors: tuple[int, ...]  # indices of the gates that end a sector; gate 0 ends the last
    grid: Floats  # (S, 3) start places x, y [m], heading [rad], pole position first
    spots: Floats  # (I, 2) item boxes x, y [m]
    obstacles: tuple[Obstacle, ...]
    starts: Floats  # (B, 6) boxes of random starts: x0, x1, y0, y1 [m], heading, spread [rad]
    width_min: float  # [m] free width between the borders at the narrowest
    width_mean: float  # [m]
    width_max: float  # [m]
    digest: str  # of the file's contents
    lot: Lot | None = None  # slots to park in, if it has some

    @property
    def length(self) -> float:
        """Length of the centre line [m]."""
        return len(self.line) * self.spacing

    def edges(self, beyond: float = 0.0) -> tuple[Floats, Floats]:
        """Return the left and right edge of the asphalt (N, 2) [m], moved `beyond` [m] outwards."""
        heading = self.line[:, 2]
        across = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
        left = self.line[:, :2] + (self.half_widths[:, :1] + beyond) * across
        return left, self.line[:, :2] - (self.half_widths[:, 1:] + beyond) * across
