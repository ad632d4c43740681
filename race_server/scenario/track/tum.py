"""Courses of the TUM racetrack database and of the f1tenth maps: CSV of a centre line.

Lines of ``x_m, y_m, w_tr_right_m, w_tr_left_m``, the first point not repeated.
"""

from pathlib import Path

import numpy as np

from race_server.errors import TrackError
from race_server.scenario.track.course import Floats


def read_tum(path: Path) -> Floats:
    """Return points of a centre line with half-widths, shape (N, 4): x, y, left, right [m].

    Raises:
        TrackError: the file cannot be read or holds something else.
    """
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TrackError(f"{path}: cannot be read: {error}") from error
    rows = []
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
    points = np.array(rows).reshape(-1, 4)
    if len(points) > 1 and np.hypot(*(points[0] - points[-1])[:2]) < 1e-6:
        points = points[:-1]
    if len(points) < 4:
        raise TrackError(f"{path}: {len(points)} points make no course")
    return points
