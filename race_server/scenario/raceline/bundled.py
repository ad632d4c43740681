"""Limits of the bundled tracks, which therefore need no solver.

A file beside the tracks holds the solution, in single precision. Its name is a digest of the track
file and of the vehicle's limits, not of the code that solved it; a test compares the files with a
fresh solution. Write them again with ``python -m race_server.scenario.raceline.export``.
"""

import contextlib
import hashlib
import zipfile
from dataclasses import asdict
from pathlib import Path

import numpy as np

from race_server.scenario.raceline.baselines import OffsetLine
from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.raceline.frame import Frame, frame_of
from race_server.scenario.raceline.minimum_time import TimedLine
from race_server.scenario.raceline.result import Limit, Solution, limit_of
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.load import own_tracks

# Rows of a file: three for each line, and the speeds of the best.
_ROWS = 10


def limits_folder() -> Path:
    """Return the folder of the bundled limits."""
    return own_tracks() / "limits"


def bundled_name(course: Course, bounds: Bounds) -> str:
    """Return the name of the file that holds a limit.

    Six digits of each bound: the last bits of a sine differ from machine to machine. Obstacles
    that were put on a course, and follow a plus sign in its digest, do not count.
    """
    figures = " ".join(f"{name}={value:.6g}" for name, value in asdict(bounds).items())
    empty = course.digest.partition("+")[0]
    digest = hashlib.sha256(f"{course.name} {empty} {figures}".encode()).hexdigest()
    return f"{course.name}-{digest[:12]}.npz"


def read_bundled(course: Course, bounds: Bounds) -> Limit | None:
    """Return the bundled limit, or None if there is none that can be read."""
    path = limits_folder() / bundled_name(course, bounds)
    if not path.is_file():
        return None
    with contextlib.suppress(OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        with np.load(path, allow_pickle=False) as tables:
            rows = tables["rows"].astype(np.float64)
        frame = frame_of(course, bounds)
        if rows.shape == (_ROWS, len(frame.x)):
            return limit_of(frame, bounds, _solution(frame, rows), 0.0)
    return None


def write_bundled(course: Course, bounds: Bounds, solution: Solution) -> Path:
    """Write a solution into the folder of the bundled limits."""
    lines = (solution.best.line, solution.calm, solution.near)
    rows = [row for line in lines for row in (line.offset, line.bearing, line.curvature)]
    path = limits_folder() / bundled_name(course, bounds)
    path.parent.mkdir(exist_ok=True)
    table = np.stack([*rows, solution.best.speed]).astype(np.float32)
    np.savez_compressed(path, allow_pickle=False, rows=table)
    return path


def _solution(frame: Frame, rows: Floats) -> Solution:
    best, calm, near = (OffsetLine(*rows[first : first + 3]) for first in (0, 3, 6))
    speed = rows[9]
    time_s = float(np.sum(frame.step * best.stretch(frame) / speed))
    return Solution(TimedLine(best, speed, time_s), calm, near)
