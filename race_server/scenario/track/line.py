"""The reference line as the world holds it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from race_server.core.observation_parts import BRAKE_SHARE
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

    @property
    def held(self) -> Floats:
        """The most speed (N,) [m/s] that a vehicle may have that brakes less than the line does.

        From there BRAKE_SHARE of the line's braking, by squares of speeds, slows down in time for
        all that follows; where it does not brake yet, of the hardest braking of its lap, as far as
        the bend leaves grip for it. One pass backward, from the slowest sample, which it holds.
        """
        squares = self.speed**2
        drops = np.maximum(squares - np.roll(squares, -1), 0.0)
        across = squares * np.abs(self.curvature)
        unused = 1.0 - across / max(float(across.max()), 1e-9)
        losses = (BRAKE_SHARE * np.maximum(drops, float(drops.max()) * unused)).tolist()
        held = squares.tolist()
        count, slowest = len(held), int(np.argmin(squares))
        for index in range(slowest + count - 1, slowest, -1):
            here, there = index % count, (index + 1) % count
            held[here] = min(held[here], held[there] + losses[here])
        return np.sqrt(held)
