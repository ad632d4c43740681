"""Borders beside a centre line."""

import numpy as np

from race_server.track.course import Floats
from race_server.track.polyline import nearest_on, segments_of

# A border may come this share nearer to the centre line than asked, before it counts as folded.
FOLD = 0.01


def border_beside(line: Floats, heading: Floats, offsets: Floats) -> Floats:
    """Return the closed border at a lateral offset from a closed line, shape (M, 2).

    line: (N, 2); heading: (N,) [rad]; offsets: (N,) [m], left positive. Inside a bend that is
    tighter than the offset the border would fold over itself: the fold is cut off, so that what
    stays is nowhere nearer to the line than it should be.
    """
    across = np.stack([-np.sin(heading), np.cos(heading)], axis=1)
    border = line + offsets[:, None] * across
    distance, _ = nearest_on(segments_of(line), border)
    return np.asarray(border[distance >= (1.0 - FOLD) * np.abs(offsets) - 1e-6])
