"""Whether the gyro is off: wheels and accelerometer tell the turning rate, too, while tyres hold.

A bias that changes slowly is learned by the filter. One that jumps turns the kart's heading away
faster than fixes bring it back.
"""

import math
from dataclasses import dataclass

from race_server.core.vehicles import GRAVITY, Vehicle

# The accelerometer has to differ by more than this [rad/s] for this long [s], always the same way.
OFF, LASTS_S = 0.1, 0.25
# It is smoothed over this time [s].
SMOOTH_S = 0.15
# The wheels point ahead of how a kart turns; in the mean of that time they differ by the same, but
# for this share.
ALIKE = 0.5
# Below this speed [m/s] the accelerometer tells no turning rate.
LEAST_SPEED = 5.0
# Tyres hold up to this share of their grip. A kart that spins turns as its gyro says.
HOLDS = 0.5


@dataclass
class GyroCheck:
    """Compares the gyro with two others that tell how fast a kart turns."""

    vehicle: Vehicle
    _off: float = 0.0  # [rad/s] against the accelerometer, smoothed
    _lasted_s: float = 0.0
    _against: tuple[float, float] = (0.0, 0.0)  # [rad] wheels and accelerometer, in that time

    def bias(
        self,
        turn: float,
        steering: float,
        felt: tuple[float, float] | None,
        speed: float,
        dt: float,
    ) -> float | None:
        """Return what the gyro tells too much [rad/s], None if it is right, or nobody knows.

        turn: [rad/s] as it is told, less the bias that is known; steering: [rad]; felt: [m/s²]
        ahead and to the left; NaN or None where a sensor has nothing; speed: [m/s]; dt: [s].
        """
        rolled = speed * math.tan(steering) / self.vehicle.wheelbase
        holds = HOLDS * self.vehicle.grip * GRAVITY
        is_told = speed > LEAST_SPEED and math.isfinite(turn + rolled)
        if felt is None or not is_told or math.hypot(*felt) > holds:
            self._off = 0.0
            self._begin()
            return None
        pulled = turn - felt[1] / speed
        was, self._off = self._off, self._off + min(dt / SMOOTH_S, 1.0) * (pulled - self._off)
        if abs(self._off) < OFF or was * self._off < 0.0:
            self._begin()
            return None
        self._lasted_s += dt
        wheels, accelerometer = self._against
        self._against = wheels + dt * (turn - rolled), accelerometer + dt * pulled
        if self._lasted_s < LASTS_S:
            return None
        wheels, accelerometer = (way / self._lasted_s for way in self._against)
        self._off = 0.0
        self._begin()
        is_alike = abs(wheels - accelerometer) < ALIKE * abs(accelerometer)
        return 0.5 * (wheels + accelerometer) if is_alike else None

    def _begin(self) -> None:
        self._lasted_s, self._against = 0.0, (0.0, 0.0)
