"""Where a real kart is: position fixes, wheel speed and gyro in one extended Kalman filter.

State: place of the rear axle's middle, which rolls where the body points, heading, speed, yaw
rate, and the gyro's bias. Between readings the kart drives on at constant speed and turn rate; what
it may do instead is process noise of its acceleration and yaw acceleration. The update is Joseph's
form, which keeps the covariance positive whatever is rounded; readings that the filter finds hardly
possible are dropped by a chi-square gate, but not for ever.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

X, Y, HEADING, SPEED, YAW_RATE, BIAS = range(6)
STRAIGHT = 1e-4  # [rad/s] turns slower than this are driven as straight lines
# 99.9 % of all honest readings of one and of two numbers pass these squares.
GATE_ONE, GATE_TWO = 10.83, 13.82
# So many readings of a sensor refused in a row: the filter is wrong, not they.
MOST_REFUSED = 5
# A kart that slides keeps its direction for about so long.
SLIDE_S = 0.1
# Variance [rad²] of a heading that is known to about 20 degrees.
ROUGH = 0.15


@dataclass(frozen=True)
class Agility:
    """How far a kart departs from constant speed and turn rate, as standard deviations."""

    acceleration: float = 3.0  # [m/s²]
    yaw_acceleration: float = 4.0  # [rad/s²]
    bias_drift: float = 1e-3  # [rad/s] in a second, of the gyro


def drive_on(state: Floats, dt: float) -> Floats:
    """Return the state `dt` seconds later at constant speed and turn rate."""
    x, y, heading, speed, rate, bias = state
    cos, sin = math.cos(heading), math.sin(heading)
    after = heading + rate * dt
    if abs(rate) > STRAIGHT:
        x += speed / rate * (math.sin(after) - sin)
        y += speed / rate * (cos - math.cos(after))
    else:
        x += speed * cos * dt
        y += speed * sin * dt
    return np.array([x, y, after, speed, rate, bias])


def jacobian_of(state: Floats, dt: float) -> Floats:
    """Return the derivative of `drive_on` by the state, shape (6, 6)."""
    _, _, heading, v, w, _ = state
    cos, sin = math.cos(heading), math.sin(heading)
    c, s = math.cos(heading + w * dt), math.sin(heading + w * dt)
    result = np.eye(6)
    result[HEADING, YAW_RATE] = dt
    if abs(w) > STRAIGHT:
        result[X, HEADING] = v / w * (c - cos)
        result[Y, HEADING] = v / w * (s - sin)
        result[X, SPEED] = (s - sin) / w
        result[Y, SPEED] = (cos - c) / w
        result[X, YAW_RATE] = v / w * dt * c - v / (w * w) * (s - sin)
        result[Y, YAW_RATE] = v / w * dt * s - v / (w * w) * (cos - c)
    else:
        result[X, HEADING], result[Y, HEADING] = -v * sin * dt, v * cos * dt
        result[X, SPEED], result[Y, SPEED] = cos * dt, sin * dt
        result[X, YAW_RATE] = -0.5 * v * sin * dt * dt
        result[Y, YAW_RATE] = 0.5 * v * cos * dt * dt
    return result


def process_noise(heading: float, dt: float, agility: Agility) -> Floats:
    """Return what driving on for `dt` seconds adds to the covariance, shape (6, 6)."""
    half = 0.5 * dt * dt
    ways = np.zeros((6, 2))
    ways[:, 0] = half * math.cos(heading), half * math.sin(heading), 0.0, dt, 0.0, 0.0
    ways[:, 1] = 0.0, 0.0, half, 0.0, dt, 0.0
    squares = np.array([agility.acceleration**2, agility.yaw_acceleration**2])
    result: Floats = (ways * squares) @ ways.T
    result[BIAS, BIAS] += agility.bias_drift**2 * dt
    return result


def antenna_at(state: Floats, lever: float) -> Floats:
    """Return the place of an antenna `lever` [m] ahead of the rear axle, shape (2,)."""
    heading = state[HEADING]
    return np.array([state[X] + lever * math.cos(heading), state[Y] + lever * math.sin(heading)])


def antenna_jacobian(state: Floats, lever: float) -> Floats:
    """Return the derivative of `antenna_at` by the state, shape (2, 6)."""
    result = np.zeros((2, 6))
    result[0, X] = result[1, Y] = 1.0
    result[0, HEADING] = -lever * math.sin(state[HEADING])
    result[1, HEADING] = lever * math.cos(state[HEADING])
    return result


def wrap(angle: float) -> float:
    """Return an angle [rad] moved by whole turns into [-pi, pi]."""
    return math.remainder(angle, 2.0 * math.pi)


class Fusion:
    """The filter. `predict` to the time of a reading, then hand in the reading."""

    def __init__(
        self, x: float, y: float, heading: float, *, lever: float, agility: Agility | None = None
    ) -> None:
        """Begin at rest, the antenna at (x, y); the heading is known to about 20 degrees."""
        self._lever = lever
        self._agility = agility or Agility()
        back_x, back_y = x - lever * math.cos(heading), y - lever * math.sin(heading)
        self.state: Floats = np.array([back_x, back_y, heading, 0.0, 0.0, 0.0])
        self.covariance: Floats = np.diag([1.0, 1.0, ROUGH, 0.25, 0.25, 2.5e-3])
        self._refused: dict[str, int] = {}  # readings in a row that were not believed

    def predict(self, dt: float, *, slip: float = 0.0, blow: float = 0.0) -> None:
        """Drive on for `dt` seconds.

        slip: standard deviation [m/s] of the rear axle's speed across; blow: [m/s²] that no tyre
        can have caused. Who is pushed moves where the body does not point, at up to the speed that
        it had.
        """
        if dt <= 0.0:
            return
        slope = jacobian_of(self.state, dt)
        heading = float(self.state[HEADING])
        noise = process_noise(heading, dt, self._agility)
        aside = np.array([-math.sin(heading), math.cos(heading), 0.0, 0.0, 0.0, 0.0])
        noise += slip * slip * SLIDE_S * dt * np.outer(aside, aside)
        self.state = drive_on(self.state, dt)
        self.state[HEADING] = wrap(float(self.state[HEADING]))
        self.covariance = slope @ self.covariance @ slope.T + noise
        if blow > 0.0:
            speed = abs(float(self.state[SPEED])) + blow * dt
            slid, turned = speed * speed * SLIDE_S * dt, (blow * dt) ** 2
            self.covariance += np.diag([slid, slid, 0.0, turned, 0.0, 0.0])

    def see_position(self, x: float, y: float, deviation: float) -> bool:
        """Take a position fix; False if it was not believed."""
        residual = np.array([x, y]) - antenna_at(self.state, self._lever)
        slope = antenna_jacobian(self.state, self._lever)
        noise = np.eye(2) * deviation**2
        return self._update("position", residual, slope, noise, GATE_TWO)

    def see_speed(self, speed: float, deviation: float) -> bool:
        """Take the speed of the wheels; False if it was not believed."""
        return self._see_one("speed", speed - float(self.state[SPEED]), (SPEED,), deviation)

    def see_yaw_rate(self, rate: float, deviation: float) -> bool:
        """Take the gyro's turning rate, bias and all; False if it was not believed."""
        expected = float(self.state[YAW_RATE] + self.state[BIAS])
        return self._see_one("yaw rate", rate - expected, (YAW_RATE, BIAS), deviation)

    def _see_one(
        self, sensor: str, residual: float, columns: tuple[int, ...], deviation: float
    ) -> bool:
        slope = np.zeros((1, 6))
        slope[0, list(columns)] = 1.0
        noise = np.array([[deviation**2]])
        return self._update(sensor, np.array([residual]), slope, noise, GATE_ONE)

    def _update(
        self, sensor: str, residual: Floats, slope: Floats, noise: Floats, gate: float
    ) -> bool:
        spread = slope @ self.covariance @ slope.T + noise
        inverse = np.linalg.inv(spread)
        if float(residual @ inverse @ residual) > gate:
            self._doubt(sensor, residual, slope)
            return False
        self._refused[sensor] = 0
        gain = self.covariance @ slope.T @ inverse
        self.state = self.state + gain @ residual
        self.state[HEADING] = wrap(float(self.state[HEADING]))
        keep = np.eye(6) - gain @ slope
        self.covariance = keep @ self.covariance @ keep.T + gain @ noise @ gain.T
        return True

    def _doubt(self, sensor: str, residual: Floats, slope: Floats) -> None:
        """Count a refusal; after too many in a row doubt the state by as much as it misses.

        But not the gyro's bias, which drifts and never jumps. Who lost the place has lost the
        heading too, by nobody knows how much: it must not be made to explain the place.
        """
        self._refused[sensor] = self._refused.get(sensor, 0) + 1
        if self._refused[sensor] > MOST_REFUSED:
            self._refused[sensor] = 0
            slope = slope.copy()
            slope[:, [HEADING, BIAS]] = 0.0
            self.covariance = self.covariance + slope.T @ np.diag(residual**2) @ slope
            if sensor == "position":
                self.covariance[HEADING, HEADING] += ROUGH

    @property
    def deviation(self) -> float:
        """Standard deviation [m] of the position, in its worse direction at most."""
        return math.sqrt(float(self.covariance[X, X] + self.covariance[Y, Y]))
