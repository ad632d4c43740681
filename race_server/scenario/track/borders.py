"""Borders beside a centre line."""

import numpy as np

from race_server.scenario.track.course import Floats
from race_server.scenario.track.polyline import crossings, nearest_on, segments_of

# A border may come this share nearer to the centre line than asked, before it counts as folded.
FOLD = 0.01
MOST_KNOTS = 50


def border_beside(line: Floats, heading: Floats, offsets: Floats) -> Floats:
    """Return the closed border at a lateral offset from a closed line, shape (M, 2).

    line: (N, 2); heading: (N,) [rad]; offsets: (N,) [m], left positive. Inside a bend that is
    tighter than the offset the border would fold over itself: the fold is cut off, so that what
    stays is nowhere nearer to the line than it should be.
    """
    across = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    border = line + offsets[:, None] * across
    distance, _ = nearest_on(segments_of(line), border)
    return _without_knots(border[distance >= (1.0 - FOLD) * np.abs(offsets) - 1e-6])


def _without_knots(border: Floats) -> Floats:
    """Return a border whose small loops, left where a fold was cut, end where they cross."""
    for _ in range(MOST_KNOTS):
        pairs = crossings(segments_of(border), first_only=True)
        if not len(pairs):
            break
        first, second = (int(index) for index in pairs[0])
        meeting = _meeting(segments_of(border)[first], segments_of(border)[second])
        if second - first <= len(border) // 2:
            border = np.vstack([border[: first + 1], meeting, border[second + 1 :]])
        else:
            border = np.vstack([meeting, border[first + 1 : second + 1]])
    return border


def _meeting(one: Floats, other: Floats) -> Floats:
    """Return the point at which two segments cross, shape (1, 2)."""
    along, across = one[2:] - one[:2], other[2:] - other[:2]
    offset = other[:2] - one[:2]
    share = (offset[0] * across[1] - offset[1] * across[0]) / (
        along[0] * across[1] - along[1] * across[0]
    )
    return np.asarray((one[:2] + share * along)[None, :])
