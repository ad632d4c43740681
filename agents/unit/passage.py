"""Whether any way leads past the borders that a kart sees: two arcs, one after the other.

One arc is not enough to tell: between the walls of a bend that begins, or of a chicane, no single
one is free as far as a kart needs to stop, and every racer finds a way. So a way is an arc and
then another one, driven at this speed or while braking, which lets the second be tighter.
"""

import math

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.limits import CERTAIN, Limits

Floats = NDArray[np.float64]
# This number of echoes of a border blocks a way: a single one may be off aside by its bearing.
BLOCKS = 2
# Shares of the sharpest curvature that tyres hold, and of the way on which the first arc is driven.
SHARES, FIRST = (-1.0, -0.6, -0.3, 0.0, 0.3, 0.6, 1.0), (0.25, 0.5)
# Shares of the usual braking that a kart does meanwhile.
BRAKED = (0.0, 0.5)
# The front of the body [m] that must not meet anything, and its poses that are looked at on a way.
FRONT, POSES = 1.2, 16
_TRIES = [(one, two, first) for first in FIRST for one in SHARES for two in SHARES]
_ONE, _TWO, _FIRST = (np.array(column)[:, None] for column in zip(*_TRIES, strict=True))


def leads_past(x: Floats, y: Floats, speed: float, limits: Limits) -> bool:
    """Return whether a way past some points is free as far as the kart needs to stop.

    x, y: (n,) [m] ahead of where the kart's arcs begin, and to the left.
    """
    horizon = speed * (0.5 * limits.reaction_s + speed / (2.0 * limits.promised))
    near = (x > limits.nose - FRONT) & (np.hypot(x, y) < horizon + limits.nose + FRONT)
    x, y = x[near], y[near]
    if len(x) < BLOCKS:
        return True
    return any(_is_free(x, y, speed, share * limits.promised, horizon, limits) for share in BRAKED)


def _is_free(
    x: Floats, y: Floats, speed: float, braking: float, horizon: float, limits: Limits
) -> bool:
    """Return whether any of the ways at a braking [m/s²] is free for `horizon` [m]."""
    # Racers pass a border closer than an echo of it is exact: the body is taken to be narrower.
    step = horizon / POSES
    ways = step * (np.arange(POSES) + 0.5)
    squares = np.maximum(speed * speed - 2.0 * braking * ways, 1.0)
    across = math.sqrt(max((limits.grip / CERTAIN) ** 2 - braking * braking, 0.0))
    sharpest = np.minimum(limits.sharpest, across / squares)
    curvatures = np.where(ways < _FIRST * horizon, _ONE, _TWO) * sharpest  # (M, S)
    turned = np.cumsum(curvatures, axis=1) * step
    middles = turned - 0.5 * curvatures * step
    east, north = (
        np.cumsum(np.cos(middles), axis=1) * step,
        np.cumsum(np.sin(middles), axis=1) * step,
    )
    cos, sin = np.cos(turned)[..., None], np.sin(turned)[..., None]
    dx, dy = x - east[..., None], y - north[..., None]  # (M, S, n)
    ahead, aside = dx * cos + dy * sin, dy * cos - dx * sin
    half = limits.half_width - 2.0 * limits.spare
    met = (np.abs(ahead - limits.nose + 0.5 * FRONT) < 0.5 * FRONT) & (np.abs(aside) < half)
    return bool((met.any(axis=1).sum(axis=1) < BLOCKS).any())
