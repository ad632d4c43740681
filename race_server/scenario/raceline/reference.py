"""The reference limit of a course and a vehicle: lines with their speeds, cached."""

import contextlib
import hashlib
import importlib.metadata
import time
import zipfile
from functools import cache
from pathlib import Path

import numpy as np

from race_server.core.kernels.jit import cache_root
from race_server.core.vehicles import Vehicle
from race_server.kept_file import keep
from race_server.scenario.raceline.bounds import Bounds, bounds_of
from race_server.scenario.raceline.bundled import read_bundled
from race_server.scenario.raceline.program import load_casadi
from race_server.scenario.raceline.result import NAMES, Limit, Raceline, Zone
from race_server.scenario.raceline.solution import limit_of, solve
from race_server.scenario.track.course import Course

__all__ = ["NAMES", "Limit", "Raceline", "Zone", "known_limit", "reference_limit"]


def reference_limit(
    course: Course,
    vehicle: Vehicle,
    speed_cap: float | None = None,
    margin: float | None = None,
) -> Limit:
    """Return the reference limit: bundled, from the user's cache, or newly solved.

    speed_cap: [m/s], below the vehicle's own top speed; margin: [m] between body and border, by
    default 0.05 m for a 1/10 car and in proportion for wider vehicles. The result is a local
    optimum for a point mass whose margin is kept straight across the line of its frame, so that in
    a bend a long body's corners come nearer; fixed obstacles do not count.

    Raises:
        RaceError: it must be solved and CasADi is not installed, no line fits, or the cap is no
            speed.
    """
    bounds = bounds_of(vehicle, speed_cap, margin)
    known = known_limit(course, bounds)
    if known is not None:
        return known
    load_casadi()
    started = time.perf_counter()
    solution = solve(course, bounds)
    limit = limit_of(course, bounds, solution, time.perf_counter() - started)
    _write(_cached(course, bounds), limit)
    return limit


def known_limit(course: Course, bounds: Bounds) -> Limit | None:
    """Return a limit that needs no solver: bundled, or in the user's cache; None if neither."""
    return read_bundled(course, bounds) or _read(_cached(course, bounds))


def _cached(course: Course, bounds: Bounds) -> Path:
    return cache_root() / "limits" / f"{_digest(course, bounds)}.npz"


@cache
def solver_digest() -> str:
    """Return a digest of the solver and of this package's code, on which solutions depend."""
    digest = hashlib.sha256()
    # Without the solver there is no version of it.
    with contextlib.suppress(importlib.metadata.PackageNotFoundError):
        digest.update(importlib.metadata.version("casadi").encode())
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()


def _digest(course: Course, bounds: Bounds) -> str:
    road = (course.name, course.spacing, course.kerb, course.grass)
    digest = hashlib.sha256(f"{solver_digest()} {road} {bounds}".encode())
    for numbers in (course.line, course.half_widths, course.borders):
        digest.update(np.ascontiguousarray(numbers).tobytes())
    return digest.hexdigest()[:24]


# The columns of a line in a file, in order.
_COLUMNS = (
    "progress", "distance", "x", "y", "heading", "curvature", "speed", "acceleration",
    "left", "right",
)  # fmt: skip


def _write(path: Path, limit: Limit) -> None:
    lines = {name: getattr(limit, name) for name in NAMES}
    tables = {
        name: np.stack([getattr(line, column) for column in _COLUMNS])
        for name, line in lines.items()
    }
    times = np.array([*(line.time_s for line in lines.values()), limit.solve_s])
    keep(path, lambda file: np.savez(file, allow_pickle=False, times=times, **tables))


def _read(path: Path) -> Limit | None:
    """Return the content of a file, or None if it cannot be read: then it is solved again."""
    with contextlib.suppress(OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        with path.open("rb") as file, np.load(file, allow_pickle=False) as tables:
            *times, solve_s = tables["times"].tolist()
            lines = [
                Raceline(time_s, **dict(zip(_COLUMNS, tables[name], strict=True)))
                for name, time_s in zip(NAMES, times, strict=True)
            ]
        return Limit(solve_s, *lines)
    return None
