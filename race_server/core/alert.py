"""What a real kart sees, what it advises, and why it slows down or brakes by itself.

The numbers of all enumerations are those of `schemas/codes.fbs`; a test compares them.
"""

import math
from dataclasses import dataclass
from enum import IntEnum, IntFlag
from typing import Any

from race_server.core.messages import RayHit


class DangerStage(IntEnum):
    """How far a danger has come that a real kart sees."""

    NONE = 0
    INFORM = 1  # no action is needed
    WARN = 2  # its driver should act
    EASE = 3  # the kart slows down by itself
    FULL = 4  # the kart brakes fully by itself


class Advice(IntEnum):
    """What the driver of a real kart should do."""

    NONE = 0
    BRAKE = 1
    STEER_LEFT = 2
    STEER_RIGHT = 3
    WAIT = 4  # the kart stands: something is in front of it


class Cause(IntFlag):
    """What made the reflex of a real kart act."""

    NONE = 0
    OBSTACLE = 1  # something will be hit unless the kart brakes
    DRIVER = 2  # the driver has let go
    LINK = 4  # the server is silent
    SPEED = 8  # faster than this kart may ever be
    FENCE = 16  # outside the course
    LOST = 32  # the kart does not know where it is
    GAME = 64  # the program that brings orders and driver is silent
    SENSOR = 128  # a sensor has failed that the kart needs

    def as_json(self) -> list[str]:
        """Return the names of all that apply."""
        return [cause.name.lower() for cause in Cause if cause.name and cause & self]


@dataclass(frozen=True, slots=True)
class Danger:
    """The worst that is ahead of a real kart."""

    stage: DangerStage = DangerStage.NONE
    kind: RayHit = RayHit.NOTHING
    bearing: float = 0.0  # [rad] from straight ahead, left positive
    distance: float = math.inf  # [m] from the middle of the front bumper
    time_s: float = math.inf  # until they meet
    needed: float = 0.0  # [m/s²] of braking, from now on
    advice: Advice = Advice.NONE


@dataclass(frozen=True, slots=True)
class Alert:
    """What a real kart says that it sees, and why it slows down or brakes by itself."""

    stamp_us: int  # of the kart's own clock
    danger: Danger = Danger()
    cause: Cause = Cause.NONE

    @property
    def gist(self) -> tuple[DangerStage, RayHit, Cause]:
        """What has to be told at once when it changes."""
        return self.danger.stage, self.danger.kind, self.cause

    def as_json(self) -> dict[str, Any]:
        """Return plain data; what has a name by its name, what is not known by null."""
        danger = self.danger
        return {
            "stage": danger.stage.name.lower(),
            "cause": self.cause.as_json(),
            "kind": danger.kind.name.lower(),
            "bearing": danger.bearing,
            "distance": danger.distance if danger.distance < math.inf else None,
            "time_s": danger.time_s if danger.time_s < math.inf else None,
            "needed": danger.needed,
            "advice": danger.advice.name.lower(),
        }
