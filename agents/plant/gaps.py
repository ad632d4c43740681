"""Distances between the outlines of bodies and borders."""

import numpy as np

from race_agents.plant.radar import Floats


def gap_between(body: Floats, other: Floats) -> float:
    """Return the least distance [m] of a body's sides (4, 4) to other segments (n, 4).

    It is 0 where two cross. Where they do not, an end of one is nearest to the other.
    """
    ends = [
        _to_segments(one.reshape(-1, 2), two).min() for one, two in ((body, other), (other, body))
    ]
    return 0.0 if _cross(body, other) else float(min(ends))


def _cross(one: Floats, two: Floats) -> bool:
    """Return whether any segments of (n, 4) and (m, 4) cross."""

    def sides(lines: Floats, points: Floats) -> Floats:
        """Return on which side of lines (n, 4) points (m, 2) are, (n, m)."""
        edge = lines[:, 2:] - lines[:, :2]
        off = points - lines[:, None, :2]
        return np.asarray(np.sign(edge[:, None, 0] * off[..., 1] - edge[:, None, 1] * off[..., 0]))

    parted = sides(one, two[:, :2]) != sides(one, two[:, 2:])
    divided = sides(two, one[:, :2]) != sides(two, one[:, 2:])
    return bool((parted & divided.T).any())


def _to_segments(points: Floats, segments: Floats) -> Floats:
    """Return the distances of points (n, 2) to segments (m, 4), (n, m) [m]."""
    start, edge = segments[:, :2], segments[:, 2:] - segments[:, :2]
    square = np.maximum((edge * edge).sum(axis=1), 1e-12)
    share = np.clip((((points[:, None] - start) * edge).sum(axis=2) / square), 0.0, 1.0)
    return np.hypot(*(points[:, None] - start - share[..., None] * edge).transpose(2, 0, 1))
