"""The line midway between an outer and an inner border."""

import numpy as np

from race_server.scenario.track.course import Floats
from race_server.scenario.track.polyline import (
    area_of,
    derivatives,
    lengths_of,
    nearest_on,
    resample,
    segments_of,
    smooth,
)

ROUNDS = 50
LAST_ROUNDS = 5  # at the final spacing; the rounds before are that much coarser
COARSE = 2.0
# While the line settles it is smoothed a little, less in each round.
FIRST_SMOOTHING = 1.5
FIRST_STEP = 0.2  # [m] from the inner border to where the walk begins
MOST_STEP = 0.1  # [m] of the walk in one round


def medial_line(outer: Floats, inner: Floats, spacing: float) -> tuple[Floats, Floats]:
    """Return the closed medial line (N, 2) and the distance to the borders (N,) [m].

    outer, inner: closed polylines. The line holds all points between them that are as near to
    the one as to the other. It starts beside the inner border and walks half of the difference
    of the two distances away from the nearer border until it settles.
    """
    walls_out, walls_in = segments_of(outer), segments_of(inner)
    coarse = COARSE * spacing
    line = _beside(inner, round(lengths_of(inner).sum() / coarse))
    for turn in range(ROUNDS):
        line = _towards_middle(line, walls_out, walls_in)
        softness = FIRST_SMOOTHING * max(1.0 - turn / (0.7 * ROUNDS), 0.0)
        if softness > 0.0:
            line = smooth(line, softness)
        line = _respaced(line, coarse)
    for _ in range(LAST_ROUNDS):
        line = _respaced(_towards_middle(line, walls_out, walls_in), spacing)
    clear_out, _ = nearest_on(walls_out, line)
    clear_in, _ = nearest_on(walls_in, line)
    return line, np.minimum(clear_out, clear_in)


def _respaced(line: Floats, spacing: float) -> Floats:
    return resample(line, max(round(lengths_of(line).sum() / spacing), 32))


def _beside(inner: Floats, count: int) -> Floats:
    """Return a line just outside the inner border, where the walk begins."""
    line = resample(inner, count)
    heading, _ = derivatives(smooth(line, 2.0))
    side = 1.0 if area_of(inner) > 0.0 else -1.0
    return line + FIRST_STEP * side * np.stack([np.sin(heading), -np.cos(heading)], axis=1)


def _towards_middle(line: Floats, walls_out: Floats, walls_in: Floats) -> Floats:
    """Return the line after every point has moved away from the border that it is nearer to."""
    to_outer, outer_point = nearest_on(walls_out, line)
    to_inner, inner_point = nearest_on(walls_in, line)
    inner_nearer = to_inner < to_outer
    away = line - np.where(inner_nearer[:, None], inner_point, outer_point)
    length = np.maximum(np.minimum(to_inner, to_outer), 1e-9)
    step = np.minimum(0.5 * np.abs(to_outer - to_inner), MOST_STEP)
    return np.asarray(line + (step / length)[:, None] * away)
