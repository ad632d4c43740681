"""Help with the pedals, from none to a kart that brakes and accelerates by itself.

The same as on the page, `web/src/input/assistance.ts`, to the last bit: both are tested on the same
situations. It follows the reference line; the driver steers, and pressing the brake always counts.
"""

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Protocol

from race_server.core.messages import Flag, KartFlag, Phase, Status
from race_server.core.state import Floats


class Level(IntEnum):
    """From least to most: each includes the one before it."""

    NONE = 0
    LINE = 1  # the line is drawn; nothing is done
    BRAKES = 2
    PEDALS = 3


# In the slowest bend the limit is this share of the line's speed, on the fastest straight all of
# it: people miss the line by a metre, and bends are tighter there.
BEND_SHARE = 0.85
# Delay from the picture to the action of the brakes [s].
LATE_S = 0.2
# Relative excess of speed for full brake, relative lack of speed for full throttle.
RANGE = 0.1
LEAST_SPEED = 0.1  # [m/s]
PRESSED = 0.05  # of a pedal


@dataclass(frozen=True)
class Pedals:
    """What a driver does with the pedals, or what is done for him."""

    throttle: float  # [-1, 1], less than zero for reverse
    brake: float  # [0, 1]
    does: str = ""  # what the assistance does now: accelerate, brake or nothing


@dataclass(frozen=True)
class Situation:
    """What the kart is in."""

    x: float  # [m]
    y: float  # [m]
    heading: float  # [rad]
    speed: float  # [m/s]
    speed_cap: float  # [m/s]
    phase: Phase
    lights: int  # that are on
    status: Status
    kart_flags: KartFlag
    flag: Flag  # shown to this kart


class SpeedLine(Protocol):
    """A closed line with the speeds along it: a reference line, or what clients receive of one."""

    @property
    def spacing(self) -> float:
        """Length between samples [m]."""

    @property
    def x(self) -> Floats:
        """East (N,) [m]."""

    @property
    def y(self) -> Floats:
        """North (N,) [m]."""

    @property
    def speed(self) -> Floats:
        """Speeds (N,) [m/s]."""


class Guide:
    """A line as the assistance reads it."""

    def __init__(self, line: SpeedLine) -> None:
        """Take the samples of the line."""
        self.spacing = line.spacing
        self.x: list[float] = line.x.tolist()
        self.y: list[float] = line.y.tolist()
        self.speed: list[float] = line.speed.tolist()
        self.slowest, self.fastest = min(self.speed), max(self.speed)

    def nearest(self, x: float, y: float) -> int:
        """Return the sample nearest to a point, the first of equals."""
        squares = [
            (ahead - x) ** 2 + (aside - y) ** 2 for ahead, aside in zip(self.x, self.y, strict=True)
        ]
        return squares.index(min(squares))

    def allowed_speed(self, near: int, speed: float) -> float:
        """Return the allowed speed [m/s] at a sample, and a moment later."""
        samples = math.floor((LATE_S * max(speed, 0.0)) / self.spacing + 0.5)
        later = (near + samples) % len(self.speed)
        return min(self._with_margin(near), self._with_margin(later))

    def _with_margin(self, index: int) -> float:
        speed, span = self.speed[index], self.fastest - self.slowest
        share = (speed - self.slowest) / span if span > 0.0 else 1.0
        return speed * (BEND_SHARE + (1.0 - BEND_SHARE) * share)

    def is_along(self, near: int, heading: float) -> bool:
        """Return whether a heading [rad] is within 60° of the line's direction."""
        following = (near + 1) % len(self.x)
        dx, dy = self.x[following] - self.x[near], self.y[following] - self.y[near]
        return dx * math.cos(heading) + dy * math.sin(heading) > 0.5 * math.hypot(dx, dy)


def assist(level: Level, own: Pedals, situation: Situation, guide: Guide | None) -> Pedals:
    """Return the pedals for what a driver does, with assistance."""
    # No assistance in reverse, or across the track.
    if level < Level.BRAKES or guide is None or own.throttle < 0.0 or not _is_racing(situation):
        return own
    near = guide.nearest(situation.x, situation.y)
    if not guide.is_along(near, situation.heading):
        return own
    left = min(guide.allowed_speed(near, situation.speed), situation.speed_cap)
    allowed = max(left, LEAST_SPEED)
    over = (situation.speed - allowed) / (RANGE * allowed)
    if over > 0.0:
        brake = max(own.brake, min(over, 1.0))
        return Pedals(0.0, brake, "brake" if own.brake < PRESSED else "")
    if level == Level.BRAKES or own.brake > PRESSED:
        return own
    throttle = min(max(-over, 0.0), 1.0)
    return replace(
        own, throttle=throttle, brake=0.0, does="" if own.throttle > PRESSED else "accelerate"
    )


def _is_racing(situation: Situation) -> bool:
    out = situation.kart_flags & (KartFlag.WRONG_WAY | KartFlag.RESCUE_OFFERED)
    is_on = situation.phase is Phase.RUNNING and situation.lights <= 0
    is_free = situation.flag is not Flag.RED and situation.status is Status.RACING
    return is_on and is_free and not out
