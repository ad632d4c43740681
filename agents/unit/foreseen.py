"""Where objects will be along the arcs that a kart may drive, and when it meets them.

All n objects are looked at along all A arcs at once, at T moments.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.limits import Limits
from race_agents.unit.safety import STRAIGHT
from race_agents.unit.track import Track
from race_server.core import codes

Floats = NDArray[np.float64]

# The future is looked at in these steps, this far [s].
STEP_S, FORESEEN_S = 0.1, 5.0
TIMES = np.arange(0.0, FORESEEN_S, STEP_S)
# Closing more slowly than this [m/s] is no danger.
CREEP = 0.5
# A kart whose nearest point lies less than this [m] ahead of the bumper is being passed.
PASSED = 0.8


@dataclass(frozen=True, eq=False)
class Foreseen:
    """Where objects will be at `TIMES`, in the frames of arcs, and how fast they go along them."""

    along: Floats  # (A, n, T) [m]
    aside: Floats  # (A, n, T) [m] to the left
    pace: Floats  # (A, n) [m/s] now
    gap: Floats  # (A, n, T) [m] from the bumper, if the kart drives on
    passes: NDArray[np.bool_]  # (A, n, T) whether the kart's body is there then

    def comes_nearer(self) -> NDArray[np.bool_]:
        """Return which objects come nearer to the arc, and not just so, shape (A, n)."""
        now, soon = np.abs(self.aside[..., 0]), np.abs(self.aside[..., 1])
        return np.asarray(now - soon > CREEP * STEP_S)

    def first_within(self, beside: Floats) -> NDArray[np.int64]:
        """Return the step at which each object is met (A, n), -1 for never.

        beside: how far from an arc each object is met [m], shape (n, T).
        """
        meets = self.passes & (np.abs(self.aside) < beside)
        return np.where(meets.any(axis=-1), meets.argmax(axis=-1), -1)


@dataclass(frozen=True, eq=False)
class Movers:
    """Objects beside arcs, as numbers."""

    x: Floats  # (n, 1) [m]
    y: Floats  # (n, 1) [m]
    vx: Floats  # (n, 1) [m/s]
    vy: Floats  # (n, 1) [m/s]
    least_ahead: Floats  # (n, 1) [m]: what lies less far ahead can only be touched from the side
    seconds: Floats  # (n, T) or (T,) that each takes at its speed of now for its way until `TIMES`
    curvature: Floats  # (A, 1, 1) [1/m]

    @classmethod
    def of(cls, tracks: Sequence[Track], curvatures: Sequence[float], limits: Limits) -> "Movers":
        """Return all objects beside each arc."""
        numbers = [(*track.state.tolist()[:2], *track.velocity) for track in tracks]
        x, y, vx, vy = np.array(numbers).T[:, :, None]
        ahead = [limits.nose + PASSED * (track.kind == codes.KART_HIT) for track in tracks]
        seconds = TIMES
        if any(track.braking > 0.0 for track in tracks):
            seconds = np.stack([_seconds_of_way(track) for track in tracks])
        arcs = np.array(curvatures, np.float64)[:, None, None]
        return cls(x, y, vx, vy, np.array(ahead)[:, None], seconds, arcs)

    def straight_on(self, speed: float, limits: Limits) -> Foreseen:
        """Return where objects are that go straight on over ground."""
        x, y = self.x + self.vx * self.seconds, self.y + self.vy * self.seconds
        along, aside = _beside_arcs(x, y, self.curvature)
        pace, _ = self._along(along[..., :1])
        return self._foreseen(along, aside, pace, speed, limits)

    def along_with(self, speed: float, limits: Limits) -> Foreseen:
        """Return where objects are that turn as the arc does."""
        along, aside = _beside_arcs(self.x, self.y, self.curvature)
        pace, leaves = self._along(along)
        along_then, aside_then = along + pace * self.seconds, aside + leaves * self.seconds
        return self._foreseen(along_then, aside_then, pace, speed, limits)

    def _along(self, way: Floats) -> tuple[Floats, Floats]:
        """Return how fast objects go along arcs, and to the left of them [m/s], (A, n, 1) each.

        way: how far along the arc each is now [m], shape (A, n, 1).
        """
        turned = self.curvature * way
        cos, sin = np.cos(turned), np.sin(turned)
        return self.vx * cos + self.vy * sin, self.vy * cos - self.vx * sin

    def _foreseen(
        self, along: Floats, aside: Floats, pace: Floats, speed: float, limits: Limits
    ) -> Foreseen:
        gap = along - (limits.nose + speed * TIMES)
        length = limits.nose + 0.5  # behind the bumper until nothing can be touched
        is_there = gap <= 0.0
        passes = is_there & (gap > -length)
        # It may be through in a step; but what is half a turn ahead is half a turn behind.
        is_half = (along[..., :-1] - along[..., 1:]) * np.abs(self.curvature) > math.pi
        passes[..., 1:] |= is_there[..., 1:] & ~is_there[..., :-1] & ~is_half
        passes &= along[..., :1] >= self.least_ahead
        return Foreseen(along, aside, pace[..., 0], gap, passes)


def _seconds_of_way(track: Track) -> Floats:
    """Return how long an object takes at its speed of now for its way until each of `TIMES` [s].

    That is less for one which told that it brakes: it goes on to do so until it stands.
    """
    speed = math.hypot(*track.velocity)
    if track.braking <= 0.0 or speed < CREEP:
        return TIMES
    rate = track.braking / speed
    brakes = np.minimum(TIMES, 1.0 / rate)
    return np.asarray(brakes - 0.5 * rate * brakes**2)


def _beside_arcs(x: Floats, y: Floats, curvature: Floats) -> tuple[Floats, Floats]:
    """Return how far along arcs points lie, and how far to the left of them [m], (A, n, S) each.

    x, y: (n, S) [m]; curvature: (A, 1, 1) [1/m] of arcs that begin at the origin along x.
    """
    bends = np.abs(curvature) >= STRAIGHT
    radius = 1.0 / np.where(bends, curvature, 1.0)
    outside, side = radius - y, np.sign(radius)
    along = radius * np.arctan2(side * x, side * outside)
    aside = radius - side * np.hypot(x, outside)
    return np.where(bends, along, x), np.where(bends, aside, y)
