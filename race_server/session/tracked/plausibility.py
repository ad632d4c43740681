"""What a kart can do at most, and what speaks against a pose that claims more."""

import math
from dataclasses import dataclass, replace

from race_server.core.messages import Pose, PoseFault
from race_server.core.vehicles import GRAVITY, Vehicle

# A pose older than this is of no use; one lost message and 90 ms of delay at 10 Hz are less.
STALE_S = 0.4
LEAST_QUALITY = 0.2
# What a message may be late by, as the clock sees it; it counts at the kart's speed.
JITTER_S = 0.03
STRAIGHT = 1e-4  # [rad/s] turns slower than this are driven as straight lines


@dataclass(frozen=True)
class PlausibilityLimits:
    """What a kart of a kind can do at most."""

    speed: float  # [m/s] ahead
    reverse: float  # [m/s]
    acceleration: float  # [m/s²]
    jump: float  # [m] by which a pose may miss where the kart was expected
    deviation: float  # [m] a position less certain than this is of no use

    @classmethod
    def of(cls, vehicle: Vehicle) -> "PlausibilityLimits":
        """Return the gates of a vehicle: its limits, a boost, and some room."""
        return cls(
            speed=1.3 * vehicle.top_speed + 0.5,
            reverse=2.0 * vehicle.reverse_speed + 0.5,
            acceleration=2.0 * vehicle.grip * GRAVITY,
            jump=0.5 * vehicle.length,
            deviation=vehicle.length,
        )


def predict(pose: Pose, dt: float) -> Pose:
    """Return a pose `dt` seconds later, at the same speeds and the same yaw rate.

    The velocity turns with the body, so the way is an arc (constant turn rate and velocity).
    """
    w = pose.yaw_rate
    along, aside = dt, 0.5 * w * dt * dt
    if abs(w) > STRAIGHT:
        along, aside = math.sin(w * dt) / w, (1.0 - math.cos(w * dt)) / w
    ahead = pose.speed * along - pose.lateral_speed * aside
    left = pose.speed * aside + pose.lateral_speed * along
    cos, sin = math.cos(pose.heading), math.sin(pose.heading)
    return replace(
        pose,
        x=pose.x + ahead * cos - left * sin,
        y=pose.y + ahead * sin + left * cos,
        heading=pose.heading + w * dt,
    )


def is_jump(before: Pose, after: Pose, dt: float, gates: PlausibilityLimits) -> bool:
    """Return whether a kart cannot have got from one pose to the other in `dt` seconds."""
    if dt < 0.0:
        return True
    expected = predict(before, dt)
    miss = math.hypot(after.x - expected.x, after.y - expected.y)
    room = gates.jump + 3.0 * after.deviation + 0.5 * gates.acceleration * dt * dt
    return miss > room + JITTER_S * abs(before.speed)


def doubt_of(pose: Pose, age_s: float, gates: PlausibilityLimits, *, is_inside: bool) -> PoseFault:
    """Return what speaks against a pose, looked at alone."""
    if age_s > STALE_S:
        return PoseFault.STALE
    if pose.quality < LEAST_QUALITY or pose.deviation > gates.deviation:
        return PoseFault.POOR
    if not -gates.reverse <= pose.speed <= gates.speed:
        return PoseFault.SPEED
    return PoseFault.NONE if is_inside else PoseFault.OFF_WORLD
