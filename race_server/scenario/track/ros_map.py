"""Courses from occupancy maps: the middle of the corridor, and how far its walls are."""

import numpy as np

from race_server.scenario.track.corridor import Corridor, middle_of
from race_server.scenario.track.course import Floats
from race_server.scenario.track.occupancy_map import OccupancyMap
from race_server.scenario.track.polyline import (
    area_of,
    derivatives,
    lengths_of,
    resample,
    smooth,
)

# Standard deviation of the smoothing of the line, and distance of its points, as shares of the
# median distance to the walls. More would shorten the line by more than half a percent.
SMOOTHING, SPACING = 0.15, 0.2
MOST_POINTS = 1200
# The line moves by less than this share of what is free around it.
MOST_MOVE = 0.5
# Into an alcove a border is at most so far away, as a share of the nearest wall.
ALCOVE = 1.5
# The start lies where these shares of the lap, behind it for a grid and ahead, are straightest.
BEHIND, AHEAD = 0.12, 0.04


def points_in(occupancy: OccupancyMap, corridor: Corridor) -> Floats:
    """Return points of a centre line with half-widths, shape (N, 4): x, y, left, right [m].

    Raises:
        TrackError: the walls of the map have too many edges.
    """
    middle, clear = middle_of(corridor, occupancy.file.path)
    middle = occupancy.points_of(middle)
    clear *= occupancy.file.resolution
    line, clear = _smoothed(middle, clear, occupancy.file.resolution)
    if area_of(line) < 0.0:
        line, clear = line[::-1], clear[::-1]
    start = straightest(line)
    line, clear = np.roll(line, -start, axis=0), np.roll(clear, -start)
    heading, _ = derivatives(line)
    across = np.column_stack([-np.sin(heading), np.cos(heading)])
    reach = ALCOVE * float(clear.max())
    sides = [occupancy.ranges_to_walls(line, way, reach) for way in (across, -across)]
    return np.column_stack([line, *(np.minimum(side, ALCOVE * clear) for side in sides)])


def straightest(line: Floats) -> int:
    """Return the place of a closed line (N, 2) in equal steps at which it is best to start."""
    behind, ahead = (round(share * len(line)) for share in (BEHIND, AHEAD))
    chords = np.roll(line, -ahead, axis=0) - np.roll(line, behind, axis=0)
    return int(np.argmax(np.hypot(*chords.T)))


def _smoothed(middle: Floats, clear: Floats, step: float) -> tuple[Floats, Floats]:
    """Return the line (N, 2) without the corners of pixels, and what is free around it (N,) [m].

    middle: (M, 2) [m], with a distance `clear` (M,) [m] to the walls; step: of a pixel [m].
    """
    count = max(round(lengths_of(middle).sum() / step), 64)
    fine = resample(np.column_stack([middle, clear]), count)
    line, clear = fine[:, :2], fine[:, 2]
    typical = float(np.median(clear))
    move = smooth(line, SMOOTHING * typical / step) - line
    far = np.hypot(*move.T)
    line = line + move * np.minimum(MOST_MOVE * clear / np.maximum(far, 1e-9), 1.0)[:, None]
    count = round(min(max(lengths_of(line).sum() / (SPACING * typical), 64), MOST_POINTS))
    kept = resample(np.column_stack([line, clear]), count)
    return kept[:, :2], kept[:, 2]
