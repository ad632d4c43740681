"""Ray casting against segments in plain numpy, for processes that load no compiler."""

import numpy as np
from numpy.typing import NDArray

from race_server.scenario.track.course import Floats

# A ray along a wall does not meet it.
PARALLEL = 1e-12


def are_near(segments: Floats, x: float, y: float, reach: float) -> NDArray[np.bool_]:
    """Return which of some segments (S, 4) may come within `reach` [m] of a point, shape (S,)."""
    middle = 0.5 * (segments[:, :2] + segments[:, 2:])
    half = 0.5 * np.hypot(*(segments[:, 2:] - segments[:, :2]).T)
    return np.asarray(np.hypot(middle[:, 0] - x, middle[:, 1] - y) <= reach + half)


def first_met(
    segments: Floats, x: float, y: float, angles: Floats, reach: float
) -> tuple[Floats, NDArray[np.int64]]:
    """Return range [m] and number of the first of some segments (S, 4) along each ray, (R,) each.

    angles: (R,) [rad] of the rays from a point. Where there is none within `reach` [m] the number
    is -1 and the range `reach`.
    """
    if len(segments) == 0:
        return np.full(len(angles), reach), np.full(len(angles), -1)
    cos, sin = np.cos(angles)[:, None], np.sin(angles)[:, None]
    dx, dy = segments[:, 0] - x, segments[:, 1] - y
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    across = cos * ey - sin * ex
    across[np.abs(across) < PARALLEL] = np.nan
    ranges, share = (dx * ey - dy * ex) / across, (dx * sin - dy * cos) / across
    is_met = (ranges >= 0.0) & (share >= 0.0) & (share <= 1.0)
    ranges = np.where(is_met, ranges, np.inf)
    which = np.argmin(ranges, axis=1)
    nearest = ranges[np.arange(len(angles)), which]
    return np.minimum(nearest, reach), np.where(nearest < reach, which, -1)
