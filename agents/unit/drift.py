"""Where a body that slides goes: the arcs that a kart drives begin there, and in that direction.

Near the limit of the tyres the rear axle slides out of a bend, so the body does not move along its
nose. An arc begins where the body does not move aside. A kart that slides as a whole has no such
place within its length: its arc begins at the nearest end, turned to where that end moves.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from race_agents.unit.limits import Limits
from race_agents.unit.safety import Echoes
from race_agents.unit.track import Track

# Slower than this [rad/s] a kart turns so little that its axle is as good a place as any.
TURNS = 0.15
# The most that a direction is turned [rad]: a kart that slides further spins.
MOST = 0.8
# A rear axle that slides more than this [rad] steers the kart as well: the front wheels point where
# it does not go.
SLIDES = 0.1


@dataclass(frozen=True)
class Drift:
    """How a body moves besides along its nose."""

    pivot: float = 0.0  # [m] ahead of the rear axle, where arcs begin
    course: float = 0.0  # [rad] to the left of the nose, the direction in which they do
    slides: bool = False  # whether the rear axle steers as well

    @classmethod
    def of(cls, speed: float, slide: float, yaw_rate: float, limits: Limits) -> "Drift":
        """Return the drift of a kart that drives ahead.

        slide: [m/s] of its rear axle to the left.
        """
        pivot = -slide / yaw_rate if abs(yaw_rate) > TURNS else 0.0
        pivot = max(-limits.nose, min(pivot, limits.nose))
        course = math.atan2(slide + pivot * yaw_rate, speed)
        slides = abs(math.atan2(slide, speed)) > SLIDES
        return cls(pivot, max(-MOST, min(course, MOST)), slides)

    def limits(self, limits: Limits) -> Limits:
        """Return the limits of a body that is measured from where its arcs begin."""
        return _limits_from(limits, self.pivot) if self.pivot else limits

    def tracks(self, tracks: Sequence[Track]) -> list[Track]:
        """Return tracks as they lie from there."""
        if not tracks:
            return []
        cos, sin = math.cos(self.course), math.sin(self.course)
        both, pivot = np.zeros((4, 4)), np.array([self.pivot, 0.0, 0.0, 0.0])
        both[:2, :2] = both[2:, 2:] = (cos, sin), (-sin, cos)
        found = []
        for track in tracks:
            x, y = track.eye[0] - self.pivot, track.eye[1]
            eye = cos * x + sin * y, cos * y - sin * x
            state, covariance = both.dot(track.state - pivot), both.dot(track.covariance)
            found.append(track.with_motion(state, covariance.dot(both.T), eye))
        return found

    def echoes(self, echoes: Echoes) -> Echoes:
        """Return echoes as they lie from there."""
        cos, sin = math.cos(self.course), math.sin(self.course)
        x, y = echoes.x - self.pivot, echoes.y
        return Echoes(cos * x + sin * y, cos * y - sin * x, echoes.closing, echoes.kinds)


STRAIGHT_ON = Drift()


@dataclass(frozen=True)
class Arcs:
    """How a kart may drive on: along the arc of now, or along the one that its driver steers to."""

    speed: float  # [m/s]
    now: float  # [1/m] curvature, positive to the left
    wanted: float  # [1/m]
    drift: Drift = STRAIGHT_ON
    braking: float = 0.0  # [m/s²] that the driver asks for and the kart does already


@lru_cache(maxsize=2)  # asked twice in a turn: for what the kart sees and for what others tell
def _limits_from(limits: Limits, pivot: float) -> Limits:
    return replace(limits, nose=limits.nose - pivot)
