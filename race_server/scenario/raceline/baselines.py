"""Lines around a course that need no speed: its centre, the shortest, the least curved."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.raceline.frame import Frame
from race_server.scenario.raceline.program import Program
from race_server.scenario.track.course import Floats

# Least 1 - offset · curvature: beyond the centre of a bend the track coordinates fold over.
FOLD = 0.05
# Largest angle [rad] between a line and the centre line.
STEEPEST = 1.3
# Weight of the squared change of curvature [1/m²] in the cost: it keeps the controls from
# swinging between stations and is too small to be seen in a lap time.
CALM = 1e-6


@dataclass(frozen=True)
class OffsetLine:
    """A line in track coordinates, at the N stations of a frame."""

    offset: Floats  # (N,) [m] from the centre line, left positive
    bearing: Floats  # (N,) [rad] from the centre line's heading
    curvature: Floats  # (N,) [1/m] its own, left positive

    def stretch(self, frame: Frame) -> Floats:
        """Return length along this line per length along the centre line (N,)."""
        return np.asarray((1.0 - self.offset * frame.curvature) / np.cos(self.bearing))


def centre_line(frame: Frame) -> OffsetLine:
    """Return the centre line itself."""
    still = np.zeros(len(frame.x))
    return OffsetLine(still, still, frame.curvature)


def least_curved(frame: Frame, bounds: Bounds) -> OffsetLine:
    """Return the line with the least integral of its squared curvature."""
    offset = np.clip(0.0, frame.low, frame.high)
    curvature = frame.curvature / np.maximum(1.0 - offset * frame.curvature, FOLD)
    start = OffsetLine(offset, np.zeros(len(offset)), curvature)
    return _best_line(frame, bounds, start, shortest=False)


def shortest(frame: Frame, bounds: Bounds, start: OffsetLine) -> OffsetLine:
    """Return the shortest line that the steering allows, starting from another line."""
    return _best_line(frame, bounds, start, shortest=True)


def _best_line(frame: Frame, bounds: Bounds, start: OffsetLine, *, shortest: bool) -> OffsetLine:
    """Solve n' = (1 - n k) tan b; b' = stretch · c - k; c' free, for the least cost.

    n offset, b bearing, c the line's curvature, k the centre line's.
    """
    program = Program(len(frame.x), frame.step)
    offset = program.unknown(frame.low, frame.high, start.offset)
    bearing = program.unknown(-STEEPEST, STEEPEST, start.bearing)
    curvature = program.unknown(-bounds.curvature, bounds.curvature, start.curvature)
    change = program.unknown(-np.inf, np.inf, 0.0)
    stretch = follow_track(program, frame, offset, bearing, curvature)
    program.evolve(curvature, change)
    cost = stretch if shortest else stretch * curvature**2
    total = frame.step * program.casadi.sum1(cost + CALM * change**2)
    found = program.minimise(total, f"{frame.name}: line without speed")
    return OffsetLine(*found[:3])


def follow_track(program: Program, frame: Frame, offset: Any, bearing: Any, curvature: Any) -> Any:
    """Require that offset and bearing follow from a line's curvature; return its stretch (N,)."""
    ca, k = program.casadi, frame.curvature
    room = 1.0 - offset * k
    stretch = room / ca.cos(bearing)
    program.evolve(offset, room * ca.tan(bearing))
    program.evolve(bearing, stretch * curvature - k)
    program.keep_negative(FOLD - room)
    return stretch
