"""The reference limit of a course and a vehicle: four lines with their speeds, kept once found."""

import contextlib
import hashlib
import importlib.metadata
import tempfile
import time
import zipfile
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np

from race_server.kernels.jit import cache_root
from race_server.limit.bounds import Bounds, bounds_of
from race_server.limit.frame import Frame, frame_of
from race_server.limit.lines import Line, centre_line, least_curved, shortest
from race_server.limit.optimal import fastest_lap
from race_server.limit.profile import lap_time, speeds_on
from race_server.limit.program import load_casadi
from race_server.params import Vehicle
from race_server.track.course import Course, Floats

NAMES = ("minimum_time", "minimum_curvature", "centre_line", "shortest")
# Accelerations [m/s²] smaller than this neither drive nor brake.
COASTING = 0.25


@dataclass(frozen=True)
class Zone:
    """A stretch of a line with one thing to do."""

    what: str  # accelerate, brake or hold
    start: float  # [m] progress along the course's centre line
    end: float  # [m] the same; before `start` where the zone runs across the timing line


@dataclass(frozen=True)
class Reference:
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
    """What a vehicle can reach on a course, along four lines."""

    solve_s: float  # that it took to find them, when they were found
    minimum_time: Reference
    minimum_curvature: Reference
    centre_line: Reference
    shortest: Reference


def reference_limit(
    course: Course,
    vehicle: Vehicle,
    speed_cap: float | None = None,
    margin: float | None = None,
) -> Limit:
    """Return the reference limit, from the user's cache or newly solved.

    speed_cap: [m/s], below the vehicle's own top speed; margin: [m] between body and border, by
    default 0.05 m for a 1/10 car and in proportion for wider vehicles. The result is a local
    optimum for a point mass whose margin is kept straight across the centre line, so that in a
    bend a long body's corners come nearer; fixed obstacles do not count.

    Raises:
        RaceError: CasADi is not installed, no line fits, or the cap is no speed.
    """
    load_casadi()
    bounds = bounds_of(vehicle, speed_cap, margin)
    path = cache_root() / "limits" / f"{_digest(course, bounds)}.npz"
    kept = _read(path)
    if kept is not None:
        return kept
    limit = _solve(course, bounds)
    _write(path, limit)
    return limit


def _solve(course: Course, bounds: Bounds) -> Limit:
    started = time.perf_counter()
    frame = frame_of(course, bounds)
    calm = least_curved(frame, bounds)
    _, speeds = _profile(frame, calm, bounds)
    lap = fastest_lap(frame, bounds, calm, speeds)
    near = shortest(frame, bounds, calm)
    others = []
    for line in (calm, centre_line(frame), near):
        steps, speeds = _profile(frame, line, bounds)
        others.append(_reference(frame, line, speeds, lap_time(steps, speeds)))
    best = _reference(frame, lap.line, lap.speed, lap.time_s)
    return Limit(time.perf_counter() - started, best, *others)


def _profile(frame: Frame, line: Line, bounds: Bounds) -> tuple[Floats, Floats]:
    """Return the lengths (N,) [m] between a line's points and the speeds (N,) [m/s] there."""
    steps = _steps(frame, line)
    return steps, speeds_on(steps, line.curvature, bounds)


def _steps(frame: Frame, line: Line) -> Floats:
    stretch = line.stretch(frame)
    return np.asarray(0.5 * frame.step * (stretch + np.roll(stretch, -1)))


def _reference(frame: Frame, line: Line, speed: Floats, time_s: float) -> Reference:
    steps = _steps(frame, line)
    return Reference(
        time_s=time_s,
        progress=frame.progress,
        distance=np.cumsum(steps) - steps,
        x=frame.x - line.offset * np.sin(frame.heading),
        y=frame.y + line.offset * np.cos(frame.heading),
        heading=(frame.heading + line.bearing + np.pi) % (2.0 * np.pi) - np.pi,
        curvature=line.curvature,
        speed=speed,
        acceleration=(np.roll(speed, -1) ** 2 - speed**2) / (2.0 * steps),
    )


@cache
def _solver() -> str:
    """Return the version of the solver and of this package's code: another one, another limit."""
    digest = hashlib.sha256(importlib.metadata.version("casadi").encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _digest(course: Course, bounds: Bounds) -> str:
    words = f"{_solver()} {course.name} {course.spacing} {course.kerb} {course.grass} {bounds}"
    digest = hashlib.sha256(words.encode())
    for numbers in (course.line, course.half_widths, course.borders):
        digest.update(np.ascontiguousarray(numbers).tobytes())
    return digest.hexdigest()[:24]


# The columns of a line in a file, in order.
_COLUMNS = (
    "progress", "distance", "x", "y", "heading", "curvature", "speed", "acceleration",
)  # fmt: skip


def _write(path: Path, limit: Limit) -> None:
    lines = {name: getattr(limit, name) for name in NAMES}
    tables = {
        name: np.stack([getattr(line, column) for column in _COLUMNS])
        for name, line in lines.items()
    }
    times = np.array([*(line.time_s for line in lines.values()), limit.solve_s])
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        # Written aside and moved, so that nobody ever reads half a file.
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            np.savez(file, allow_pickle=False, times=times, **tables)
        Path(file.name).replace(path)


def _read(path: Path) -> Limit | None:
    """Return what a file holds, or None: what cannot be read is solved again."""
    with contextlib.suppress(OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        with path.open("rb") as file, np.load(file, allow_pickle=False) as tables:
            *times, solve_s = tables["times"].tolist()
            lines = [
                Reference(time_s, **dict(zip(_COLUMNS, tables[name], strict=True)))
                for name, time_s in zip(NAMES, times, strict=True)
            ]
        return Limit(solve_s, *lines)
    return None
