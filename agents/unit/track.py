"""One thing around a kart: where it is and how it moves, by a constant-velocity Kalman filter.

A radar tells how far a thing is and how fast that changes along the ray from the radar. Beside the
bumper this ray points elsewhere than the one from the rear axle, where the frame begins: by 30
degrees at 2 m.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.ego import Ego
from race_server.core import codes

Floats = NDArray[np.float64]

# An echo is of a track that lies this near [m].
GATE = 1.5
# A track moves after this many scans.
BORN = 3
# Deviations: of a thing's middle [m], of Doppler speeds [m/s], of a bearing [rad].
PLACE, DOPPLER, BEARING = 0.15, 0.2, 0.012
OUTLINE = 0.5  # [m] by which the middle of the echoes of a kart moves about
# How much a person and a kart change their speed [m/s in √s].
RESTLESS, DRIVEN = 0.7, 2.0
FIRST_SPEED = 3.0  # [m/s] deviation of what a thing may do when it is first seen
# A speed along the ray that is off by this number of deviations was changed by a blow.
HIT, UNKNOWN_SPEED = 4.0, np.diag([0.0, 0.0, FIRST_SPEED**2, FIRST_SPEED**2])
# What moves away more slowly than this [m/s] stands.
STANDS = 1.0
# The share of a new figure in the two smoothed ones of how much a thing slows down.
SLOWLY, SOON = 0.2, 0.5
# A kart in a bend is pulled across its way by this much [m/s²].
PULLED = 6.0
# A speed across the ray below this many deviations is none; of karts, whose outline comes into view
# side by side, below the second, and of those that do not move along the ray, either, the third:
# they are parked as a rule.
NOISE, PLAIN, PARKED = 1.2, 2.0, 3.0


@dataclass
class Track:
    """One thing, in the kart's frame: its nearest point's place [m] and velocity over ground."""

    state: Floats  # (4,) x, y [m], vx, vy [m/s]
    covariance: Floats  # (4, 4)
    kind: int  # RayHit
    half_width: float  # [m] across the ray
    scans: int = 1
    missed: int = 0
    slowing: float = 0.0  # [m/s²] by which its speed shrinks, see `slow_down`
    slowed: tuple[float, float] = (0.0, 0.0)  # … smoothed over five scans, and over two
    braking: float = 0.0  # [m/s²] that it told to ask of its brakes
    number: int = 0
    began: float = 0.0  # [m] away when it was first seen
    eye: tuple[float, float] = (0.0, 0.0)  # [m] where the radar is

    def with_motion(self, state: Floats, covariance: Floats, eye: tuple[float, float]) -> "Track":
        """Return the same thing in another frame; `dataclasses.replace` takes six times as long."""
        rest = self.scans, self.missed, self.slowing, self.slowed, self.braking
        return Track(
            state, covariance, self.kind, self.half_width, *rest, self.number, self.began, eye
        )

    @property
    def ray(self) -> tuple[float, float]:
        """Direction in which the radar sees it."""
        x, y = self.state[:2].tolist()
        x, y = x - self.eye[0], y - self.eye[1]
        far = max(math.hypot(x, y), 1e-6)
        return x / far, y / far

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity over ground [m/s]: across the ray none that could as well be noise."""
        cos, sin = self.ray
        vx, vy = self.state[2:].tolist()
        along, across = cos * vx + sin * vy, cos * vy - sin * vx
        (east, both), (_, north) = self.covariance[2:, 2:].tolist()
        variance = sin * sin * east - 2.0 * sin * cos * both + cos * cos * north
        clear = NOISE
        if self.kind == codes.KART_HIT:
            clear = PARKED if abs(along) < STANDS else PLAIN
        if across * across < clear**2 * variance:
            across = 0.0
        return along * cos - across * sin, along * sin + across * cos

    def unclear(self, way: float) -> float:
        """Return the part of its speed that could be noise: [m/s] to the left of a way [rad]."""
        vx, vy = self.velocity
        return float((self.state[3] - vy) * math.cos(way) - (self.state[2] - vx) * math.sin(way))

    def slow_down(self, ray: Floats, less: float) -> None:
        """Take in by how much less [m/s²] it moves along a ray (2,) than at the scan before.

        In a bend a thing beside is pulled across its way, along the ray as well: only what its
        tyres cannot do is slowing. It goes on with what both the last scans and the very last ones
        show: a kart that braked and drives on does not stop ahead.
        """
        vx, vy = self.velocity
        speed = max(math.hypot(vx, vy), STANDS)
        along, across = (vx * ray[0] + vy * ray[1]) / speed, (vy * ray[0] - vx * ray[1]) / speed
        slows, pulled = abs(along) * less, PULLED * abs(across)
        slows = math.copysign(max(abs(slows) - pulled, 0.0), slows)
        slowly, soon = self.slowed
        self.slowed = slowly + SLOWLY * (slows - slowly), soon + SOON * (slows - soon)
        self.slowing = min(self.slowed)

    @property
    def leaves(self) -> float:
        """Speed over ground along the ray [m/s], negative where it comes."""
        cos, sin = self.ray
        vx, vy = self.state[2:].tolist()
        return float(cos * vx + sin * vy)

    @property
    def stands(self) -> bool:
        """Whether it does not move away."""
        return self.leaves < STANDS

    @property
    def may_be_parked(self) -> bool:
        """Whether it moves neither away nor nearer: how it moves across the ray is known late."""
        return abs(self.leaves) < STANDS

    @property
    def unsure(self) -> float:
        """Deviation of the velocity [m/s], in its worse direction at most."""
        return math.sqrt(max(float(self.covariance[2, 2] + self.covariance[3, 3]), 0.0))


def carry(track: Track, ego: Ego, dt: float) -> None:
    """Move a track on, and into the kart's frame of now."""
    cos, sin = math.cos(ego.turned), math.sin(ego.turned)
    turn = np.array([[cos, sin], [-sin, cos]])
    state = track.state.copy()
    state[:2] += state[2:] * dt - (ego.ahead, ego.left)
    both = np.zeros((4, 4))
    both[:2, :2] = both[2:, 2:] = turn
    slope = np.eye(4)
    slope[0, 2] = slope[1, 3] = dt
    slope = both.dot(slope)
    track.state = both.dot(state)
    pace = DRIVEN if track.kind == codes.KART_HIT else RESTLESS
    noise = pace**2 * np.diag([dt**3 / 3.0, dt**3 / 3.0, dt, dt])
    track.covariance = slope.dot(track.covariance).dot(slope.T) + noise
    track.missed += 1


def correct(track: Track, place: Floats, ray: Floats, doppler: float) -> bool:
    """Correct a track by a place (2,) [m] and a speed over ground along a ray [m/s].

    What is off along the ray, across it, and in speed are three numbers that err by themselves. A
    thing whose speed is far from what was expected was hit: how it moves now is not known. Return
    whether it was.
    """
    cos, sin = ray.tolist()
    far = math.hypot(place[0] - track.eye[0], place[1] - track.eye[1])
    across = across_of(far, track.kind)
    moves = np.array([0.0, 0.0, cos, sin])
    off = doppler - float(moves.dot(track.state))
    spread = float(moves.dot(track.covariance).dot(moves))
    is_hit = off * off > HIT * HIT * (spread + DOPPLER * DOPPLER)
    if is_hit:
        track.covariance = track.covariance + UNKNOWN_SPEED
    for row, told, deviation in (
        (np.array([cos, sin, 0.0, 0.0]), cos * place[0] + sin * place[1], PLACE),
        (np.array([-sin, cos, 0.0, 0.0]), cos * place[1] - sin * place[0], across),
        (moves, doppler, DOPPLER),
    ):
        shared = track.covariance.dot(row)
        spread = float(row.dot(shared)) + deviation**2
        gain = shared / spread
        track.state = track.state + gain * (told - float(row.dot(track.state)))
        track.covariance = track.covariance - gain[:, None] * shared
    return is_hit


def spread_of(ray: Floats, far: float, kind: int) -> Floats:
    """Return the covariance of a place (2, 2) [m²]: wider across the ray the farther it is."""
    along, across = np.outer(ray, ray), np.outer((-ray[1], ray[0]), (-ray[1], ray[0]))
    return np.asarray(PLACE**2 * along + across_of(far, kind) ** 2 * across)


def across_of(far: float, kind: int) -> float:
    """Return the deviation of a place across the ray [m]. far: [m] away."""
    return math.hypot(OUTLINE if kind == codes.KART_HIT else PLACE, BEARING * far)


def distance_to(track: Track, x: float, y: float) -> float:
    """Return how far [m] a track is from a place."""
    return math.hypot(track.state[0] - x, track.state[1] - y)
