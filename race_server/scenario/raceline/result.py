"""The reference limit: closed lines with their speeds."""

from dataclasses import dataclass

import numpy as np

from race_server.scenario.raceline.baselines import OffsetLine
from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.raceline.frame import Frame
from race_server.scenario.raceline.minimum_time import TimedLine
from race_server.scenario.raceline.profile import lap_time, speeds_on
from race_server.scenario.track.course import Floats

NAMES = ("minimum_time", "with_room", "minimum_curvature", "centre_line", "shortest")
# Accelerations [m/s²] smaller than this neither drive nor brake.
COASTING = 0.25


@dataclass(frozen=True)
class Zone:
    """A stretch of a line with one thing to do."""

    what: str  # accelerate, brake or hold
    start: float  # [m] progress along the course's centre line
    end: float  # [m] the same; before `start` where the zone runs across the timing line


@dataclass(frozen=True)
class Raceline:
    """A closed line with the speed at each of its N points, for one vehicle."""

    time_s: float  # of the flying lap
    progress: Floats  # (N,) [m] along the course's centre line
    distance: Floats  # (N,) [m] along this line
    x: Floats  # (N,) [m]
    y: Floats  # (N,) [m]
    heading: Floats  # (N,) [rad] in [-pi, pi)
    curvature: Floats  # (N,) [1/m] left positive
    speed: Floats  # (N,) [m/s]
    acceleration: Floats  # (N,) [m/s²] from each point to the next
    left: Floats  # (N,) [m] free to the left, straight across the line of its frame
    right: Floats  # (N,) [m] the same to the right

    @property
    def length(self) -> float:
        """Length of the line [m]."""
        last = np.hypot(self.x[0] - self.x[-1], self.y[0] - self.y[-1])
        return float(self.distance[-1] + last)

    @property
    def zones(self) -> tuple[Zone, ...]:
        """The stretches of accelerating, braking and holding the speed, in order."""
        kinds = np.where(np.abs(self.acceleration) < COASTING, 0.0, np.sign(self.acceleration))
        starts = np.flatnonzero(kinds != np.roll(kinds, 1))
        if not len(starts):
            starts = np.array([0])
        words = {-1.0: "brake", 0.0: "hold", 1.0: "accelerate"}
        at = self.progress[starts]
        return tuple(
            Zone(words[float(kinds[first])], float(start), float(end))
            for first, start, end in zip(starts, at, np.roll(at, -1), strict=True)
        )


@dataclass(frozen=True)
class Limit:
    """The fastest laps of a vehicle on a course, along several lines."""

    solve_s: float  # time of the solver; zero if the lines were bundled or cached
    minimum_time: Raceline
    with_room: Raceline  # that drivers follow: with more room the faster it is, as a body turns
    minimum_curvature: Raceline
    centre_line: Raceline
    shortest: Raceline


def profile_of(frame: Frame, line: OffsetLine, bounds: Bounds) -> tuple[Floats, Floats]:
    """Return the lengths (N,) [m] between a line's points and the speeds (N,) [m/s] there."""
    steps = _steps(frame, line)
    return steps, speeds_on(steps, line.curvature, bounds)


def _steps(frame: Frame, line: OffsetLine) -> Floats:
    stretch = line.stretch(frame)
    return np.asarray(0.5 * frame.step * (stretch + np.roll(stretch, -1)))


def raceline_at_best(frame: Frame, bounds: Bounds, line: OffsetLine) -> Raceline:
    """Return a line with the fastest speeds that it allows."""
    steps, speeds = profile_of(frame, line, bounds)
    return raceline_of(frame, bounds, TimedLine(line, speeds, lap_time(steps, speeds)))


def raceline_of(frame: Frame, bounds: Bounds, timed: TimedLine) -> Raceline:
    """Return a line and its speeds in the plane."""
    line, speed = timed.line, timed.speed
    steps = _steps(frame, line)
    return Raceline(
        time_s=timed.time_s,
        progress=frame.progress,
        distance=np.cumsum(steps) - steps,
        x=frame.x - line.offset * np.sin(frame.heading),
        y=frame.y + line.offset * np.cos(frame.heading),
        heading=(frame.heading + line.bearing + np.pi) % (2.0 * np.pi) - np.pi,
        curvature=line.curvature,
        speed=speed,
        acceleration=(np.roll(speed, -1) ** 2 - speed**2) / (2.0 * steps),
        left=frame.high + bounds.reach - line.offset,
        right=line.offset - frame.low + bounds.reach,
    )
