"""Limits of the bundled tracks, which therefore need no solver.

A file beside the tracks holds the solution, in single precision, and the frame that its lines lie
in where that is not about the centre line. Its name is a digest of the track file and of the
vehicle's limits, not of the code that solved it; a test compares the files with a fresh solution.
Write them again with ``python -m race_server.scenario.raceline.export``.
"""

import contextlib
import hashlib
import zipfile
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import numpy as np

from race_server.scenario.raceline.baselines import OffsetLine
from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.raceline.frame import Frame, frame_of
from race_server.scenario.raceline.minimum_time import TimedLine
from race_server.scenario.raceline.result import Limit
from race_server.scenario.raceline.solution import Solution, limit_of
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.load import own_tracks

# Rows of a file: three for each line, the speeds of the lap of minimum time and of that with room.
_ROWS = 14
# Rows of its frame, in order.
_FRAME = ("progress", "x", "y", "heading", "curvature", "low", "high")


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
            frame = _frame_in(tables, course, bounds)
        if rows.shape == (_ROWS, len(frame.x)):
            return limit_of(course, bounds, _solution(frame, rows), 0.0)
    return None


def write_bundled(course: Course, bounds: Bounds, solution: Solution) -> Path:
    """Write a solution into the folder of the bundled limits."""
    best, driven = solution.best, solution.with_room
    lines = (best.line, driven.line, solution.calm, solution.near)
    rows = [row for line in lines for row in (line.offset, line.bearing, line.curvature)]
    path = limits_folder() / bundled_name(course, bounds)
    path.parent.mkdir(exist_ok=True)
    tables = {"rows": np.stack([*rows, best.speed, driven.speed]).astype(np.float32)}
    if not np.array_equal(solution.frame.x, frame_of(course, bounds).x):
        frame = np.stack([getattr(solution.frame, name) for name in _FRAME])
        tables |= {"frame": frame.astype(np.float32), "step": np.array(solution.frame.step)}
    np.savez_compressed(path, allow_pickle=False, **tables)
    return path


def _frame_in(tables: Mapping[str, Floats], course: Course, bounds: Bounds) -> Frame:
    """Return the frame of a file's lines: what it holds, or that of the centre line."""
    if "frame" not in tables:
        return frame_of(course, bounds)
    rows = dict(zip(_FRAME, tables["frame"].astype(np.float64), strict=True))
    return Frame(course.name, float(tables["step"]), **rows)


def _solution(frame: Frame, rows: Floats) -> Solution:
    lines = [OffsetLine(*rows[first : first + 3]) for first in range(0, 12, 3)]
    best, driven = (
        TimedLine(line, speed, float(np.sum(frame.step * line.stretch(frame) / speed)))
        for line, speed in zip(lines, rows[12:], strict=False)
    )
    return Solution(frame, lines[2], best, lines[3], driven)
