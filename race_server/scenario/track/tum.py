"""Courses of the TUM racetrack database and of the f1tenth maps: CSV of a centre line.

Lines of ``x_m, y_m, w_tr_right_m, w_tr_left_m``, the first point not repeated.
"""

from pathlib import Path

import numpy as np

from race_server.errors import TrackError
from race_server.scenario.text_files import read_text
from race_server.scenario.track.course import Floats
from race_server.scenario.track.limits import MOST_POINTS, check_count

# Of the largest course, with more columns than are read.
MOST_BYTES = 256 * MOST_POINTS


def read_tum(path: Path) -> Floats:
    """Return points of a centre line with half-widths, shape (N, 4): x, y, left, right [m].

    Raises:
        TrackError: the file cannot be read, is too long, or holds something else.
    """
    rows: list[tuple[float, float, float, float]] = []
    lines = read_text(path, MOST_BYTES, TrackError).splitlines()
    for number, line in enumerate(lines, start=1):
        text = line.split("#", 1)[0].strip()
        if not text:
            continue
        try:
            values = [float(word) for word in text.replace(";", ",").split(",")]
        except ValueError as error:
            raise TrackError(f"{path}, line {number}: {text[:40]!r} holds no numbers") from error
        if len(values) < 4 or not np.isfinite(values).all():
            raise TrackError(f"{path}, line {number}: expected x, y, width right, width left")
        rows.append((values[0], values[1], values[3], values[2]))
    check_count(f"points in {path}", len(rows), MOST_POINTS)
    points = np.array(rows).reshape(-1, 4)
    if len(points) > 1 and np.hypot(*(points[0] - points[-1])[:2]) < 1e-6:
        points = points[:-1]
    if len(points) < 4:
        raise TrackError(f"{path}: {len(points)} points make no course")
    return points
