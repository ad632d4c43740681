"""What a real kart tells the pit wall: how its sensors, its estimate, its link and its battery are.

The numbers of all enumerations are those of `schemas/codes.fbs`; a test compares them.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import Any

from race_server.core.alert import Alert, Cause, DangerStage
from race_server.core.messages import Pose, Source


class Sensor(IntEnum):
    """What tells a real kart where it is and what is around it."""

    FIXES = 0  # of the place, by satellites or a tracking system
    BEACONS = 1  # ranges by radio
    WHEELS = 2
    GYRO = 3
    ACCELEROMETER = 4
    STEERING = 5  # angle of the road wheels
    RADAR = 6
    LIDAR = 7


class SensorState(IntEnum):
    """What a sensor of a real kart is worth."""

    ABSENT = 0  # it has never said anything
    WELL = 1
    SILENT = 2  # nothing comes, or nothing that is a number in range
    STUCK = 3  # it repeats itself while the kart moves
    REFUSED = 4  # what it says does not agree with the other sensors


# What a kart knows of its sensors before any has spoken.
NO_SENSORS = (SensorState.ABSENT,) * len(Sensor)


@dataclass(frozen=True, slots=True)
class Health:
    """What of a real kart neither its pose nor its alert tells."""

    sensors: tuple[SensorState, ...] = NO_SENSORS  # by `Sensor`
    heading_deviation: float = 0.0  # [rad]
    link_s: float | None = None  # since the newest word of the server
    battery: float | None = None  # [0, 1] of its charge


@dataclass(frozen=True, slots=True)
class Telemetry:
    """How a real kart is, five times a second."""

    stamp_us: int  # of the kart's own clock
    x: float = 0.0  # [m] of the centre of gravity, as estimated
    y: float = 0.0
    heading: float = 0.0  # [rad]
    speed: float = 0.0  # [m/s]
    deviation: float | None = None  # [m] of the place, None where it is not known
    source: Source = Source.UNKNOWN
    stage: DangerStage = DangerStage.NONE
    cause: Cause = Cause.NONE
    health: Health = Health()

    @classmethod
    def of(cls, pose: Pose | None, alert: Alert, health: Health) -> "Telemetry":
        """Return what a kart tells of itself. pose: None before its first fix."""
        stage, cause = alert.danger.stage, alert.cause
        if pose is None:
            return cls(alert.stamp_us, stage=stage, cause=cause, health=health)
        place = pose.x, pose.y, pose.heading, pose.speed, pose.deviation, pose.source
        return cls(pose.stamp_us, *place, stage, cause, health)

    def as_json(self) -> dict[str, Any]:
        """Return plain data; what has a name by its name, what is not known by null."""
        health = self.health
        return {
            "x": self.x,
            "y": self.y,
            "heading": self.heading,
            "speed": self.speed,
            "deviation": self.deviation,
            "heading_deviation": health.heading_deviation,
            "source": self.source.name.lower(),
            "stage": self.stage.name.lower(),
            "cause": self.cause.as_json(),
            "link_s": health.link_s,
            "battery": health.battery,
            "sensors": {
                sensor.name.lower(): state.name.lower()
                for sensor, state in zip(Sensor, health.sensors, strict=True)
            },
        }
