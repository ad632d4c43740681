"""The reference line as the world holds it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from race_server.scenario.track.course import Floats


@dataclass(frozen=True, eq=False)
class ReferenceLine:
    """A closed line around a course with the speed at each place, for one vehicle.

    Its N samples lie at equal steps; there are as many as of the course's centre line, and sample 0
    lies abreast of the timing line.
    """

    spacing: float  # [m] between samples, along this line
    x: Floats  # (N,) [m]
    y: Floats  # (N,) [m]
    heading: Floats  # (N,) [rad]
    curvature: Floats  # (N,) [1/m] left positive
    speed: Floats  # (N,) [m/s]
    left: Floats  # (N,) [m] of asphalt to the left of this line, as far as an obstacle there
    right: Floats  # (N,) [m] the same to its right
    beside: NDArray[np.int64]  # (N,) sample of this line abreast of each of the centre line
    note: str = ""  # why it is used in place of the reference limit; empty if it is that
