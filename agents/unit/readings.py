"""What the sensors of a kart give, each with how good it is and when it was taken."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.safety import Echoes
from race_server.core.messages import Source

# In a second. `race_server.core.clock` has the same, but imports `time`, which no unit may.
MICROSECONDS = 1_000_000
# Rays of a lidar at most. `race_server.scenario.sensors` has the same, which no unit may import.
MOST_RAYS = 2048


@dataclass(frozen=True)
class Fix:
    """One reading of the position.

    stamp_s: time of the kart's clock at which the antenna was there, None where the receiver does
    not tell: the delay is then estimated. stamp_deviation_s: of the stamp, or the jitter of the
    delay.
    """

    x: float
    y: float
    deviation: float  # [m] in each direction
    source: Source = Source.CORRECTED_SATELLITES
    heading: float | None = None  # [rad] of a receiver with two antennas
    heading_deviation: float = 0.01  # [rad]
    stamp_s: float | None = None
    stamp_deviation_s: float = 0.0
    speed: float | None = None  # [m/s] of the antenna over the ground, by Doppler shift
    course: float = 0.0  # [rad] of that speed
    speed_deviation: float = 0.1  # [m/s]


@dataclass(frozen=True)
class Range:
    """A distance from the antenna to a radio beacon whose place is known."""

    x: float
    y: float
    distance: float  # [m]
    deviation: float = 0.1  # [m]


@dataclass(frozen=True)
class Readings:
    """What the sensors give at one moment; None or NaN where one has nothing new."""

    time_s: float  # by the kart's own clock
    wheel_speed: float  # [m/s]
    yaw_rate: float  # [rad/s] of the gyro, with its bias
    steering: float  # [rad] at the road wheels
    acceleration: tuple[float, float] | None = None  # [m/s²] ahead and to the left
    fix: Fix | None = None
    echoes: Echoes | None = None
    ranges: NDArray[np.float64] | None = None  # [m] of a lidar's rays, right to left, 0 for nothing
    beacons: tuple[Range, ...] = ()
    battery: float | None = None  # [0, 1] of its charge
