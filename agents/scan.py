"""A lidar scan made fit for driving."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def ray_angles(rays: int, field: float) -> Floats:
    """Return the angle [rad] of each ray, left positive, from right to left."""
    return np.linspace(-0.5 * field, 0.5 * field, rays)


def repair(ranges: NDArray[np.float32], reach: float) -> Floats:
    """Return ranges [m] in which drop-outs (zeros) take the value between their neighbours."""
    valid = ranges > 0.0
    if valid.all():
        return ranges.astype(np.float64)
    if not valid.any():
        return np.full(len(ranges), reach)
    places = np.arange(len(ranges))
    return np.interp(places, places[valid], ranges[valid])


def widen_edges(ranges: Floats, angle_step: float, half_width: float, jump: float) -> Floats:
    """Return ranges [m] in which every near edge hides what lies close beside it.

    Behind an edge the space is only free for a body of half-width `half_width` [m] if it passes
    that edge at this distance. Disparity extender: Otterness, 2019. jump: difference of two
    neighbouring rays [m] that counts as an edge.
    """
    widened = ranges.copy()
    steps = np.diff(ranges)
    for edge in np.flatnonzero(np.abs(steps) > jump):
        near = edge if steps[edge] > 0.0 else edge + 1
        distance = max(ranges[near], half_width)
        count = int(np.arcsin(min(half_width / distance, 1.0)) / angle_step) + 1
        first, last = (near, near + count) if steps[edge] > 0.0 else (near - count, near)
        part = slice(max(first, 0), last + 1)
        widened[part] = np.minimum(widened[part], ranges[near])
    return widened
