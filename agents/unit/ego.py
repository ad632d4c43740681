"""How a kart moves from one scan of its radar to the next, by its own speed and turning."""

import math
from dataclasses import dataclass

# A gyro's noise is that of one reading, and bends an arc by 0.3 m at 24 m: of a kart's turning this
# time [s] counts.
SMOOTH_S = 0.06


@dataclass(frozen=True)
class Ego:
    """How a kart moved since the last scan."""

    ahead: float  # [m]
    left: float  # [m]
    turned: float  # [rad]
    speed: float  # [m/s] now
    aside: float = 0.0  # [m/s] to the left, of the radar


@dataclass
class EgoMotion:
    """Adds up the way since the last scan: a fix that moves the estimate moves no object."""

    seconds: float = 0.0
    yaw_rate: float = 0.0  # [rad/s] over the last `SMOOTH_S`
    _ahead: float = 0.0
    _left: float = 0.0
    _turned: float = 0.0

    def advance(self, speed: float, slide: float, yaw_rate: float, dt: float) -> None:
        """Move on for `dt` seconds at these speeds of the rear axle [m/s] and turn [rad/s]."""
        middle = self._turned + 0.5 * yaw_rate * dt
        cos, sin = math.cos(middle), math.sin(middle)
        self._ahead += (speed * cos - slide * sin) * dt
        self._left += (speed * sin + slide * cos) * dt
        self._turned += yaw_rate * dt
        self.yaw_rate += (yaw_rate - self.yaw_rate) * dt / (SMOOTH_S + dt)
        self.seconds += dt

    def take(self, speed: float, aside: float) -> Ego:
        """Return the way since the last scan, and begin again.

        speed, aside: of the radar now [m/s], which swings aside as the kart turns.
        """
        ego = Ego(self._ahead, self._left, self._turned, speed, aside)
        self.seconds = self._ahead = self._left = self._turned = 0.0
        return ego
