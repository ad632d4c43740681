"""Where a real kart is: fixes, wheels, gyro and accelerometer in one extended Kalman filter.

State: place of the rear axle's middle, heading, speed, yaw rate, the gyro's bias, and the speed at
which the rear axle slides to the left. Between readings the kart drives on at constant speeds and
turn rate, changed by what the accelerometer feels; what it may do instead is process noise. Tyres
roll where the body points unless something else is plain (`see_grip`). The update is Joseph's
form, which keeps the covariance positive in spite of rounding. A chi-square gate refuses improbable
readings; after several refusals in a row the state itself is doubted.
"""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

X, Y, HEADING, SPEED, YAW_RATE, BIAS, SLIDE = range(7)
STRAIGHT = 1e-4  # [rad/s] turns slower than this are driven as straight lines
# 99.9 % of all honest readings of one and of two numbers pass these squares.
GATE_ONE, GATE_TWO = 10.83, 13.82
# 95 % of all slides of tyres that hold pass this square; the others are slides.
PLAIN = 3.84
# After this many readings of a sensor refused in a row: the filter is wrong, not they.
MOST_REFUSED = 5
# Fixes are rare: this many take a third of a second, in which a kart can be carried metres away.
MOST_FIXES_REFUSED = 3
# A kart that slides keeps its direction for about this time [s].
SLIDE_S = 0.1
# Variances of a heading that is known to about 20 degrees [rad²], and of a slide [m²/s²] that was
# not noticed.
ROUGH, UNNOTICED = 0.15, 4.0


@dataclass(frozen=True)
class Agility:
    """How far a kart departs from constant speed and turn rate, as standard deviations."""

    acceleration: float = 3.0  # [m/s²]
    yaw_acceleration: float = 4.0  # [rad/s²]
    slide: float = 1.5  # [m/s²] to the side, beside what the accelerometer feels
    bias_drift: float = 1e-3  # [rad/s] in a second, of the gyro


def drive_on(state: Floats, dt: float) -> Floats:
    """Return the state `dt` seconds later at constant speeds and turn rate."""
    heading, rate = float(state[HEADING]), float(state[YAW_RATE])
    along, aside = arc(rate, dt)
    cos, sin = math.cos(heading), math.sin(heading)
    ahead = state[SPEED] * along - state[SLIDE] * aside
    left = state[SPEED] * aside + state[SLIDE] * along
    result = state.copy()
    result[X] += ahead * cos - left * sin
    result[Y] += ahead * sin + left * cos
    result[HEADING] = heading + rate * dt
    return result


def arc(rate: float, dt: float) -> tuple[float, float]:
    """Return the ways ahead and to the left, per speed [s], of a body that turns.

    rate: constant yaw rate [rad/s]; dt: duration [s].
    """
    if abs(rate) > STRAIGHT:
        return math.sin(rate * dt) / rate, (1.0 - math.cos(rate * dt)) / rate
    return dt, 0.5 * rate * dt * dt


def arc_slope(rate: float, dt: float) -> tuple[float, float]:
    """Return the derivatives of `arc` by the turn rate."""
    if abs(rate) > STRAIGHT:
        along, aside = arc(rate, dt)
        cos, sin = math.cos(rate * dt), math.sin(rate * dt)
        return (dt * cos - along) / rate, (dt * sin - aside) / rate
    return -rate * dt**3 / 3.0, 0.5 * dt * dt


def jacobian_of(state: Floats, dt: float) -> Floats:
    """Return the derivative of `drive_on` by the state, shape (7, 7)."""
    heading, v, u = (float(value) for value in state[[HEADING, SPEED, SLIDE]])
    rate = float(state[YAW_RATE])
    along, aside = arc(rate, dt)
    along_slope, aside_slope = arc_slope(rate, dt)
    ahead, left = v * along - u * aside, v * aside + u * along
    turn = np.array(
        [[math.cos(heading), -math.sin(heading)], [math.sin(heading), math.cos(heading)]]
    )
    result = np.eye(len(state))
    result[HEADING, YAW_RATE] = dt
    result[:2, HEADING] = turn @ (-left, ahead)
    result[:2, SPEED] = turn @ (along, aside)
    result[:2, SLIDE] = turn @ (-aside, along)
    by_rate = v * along_slope - u * aside_slope, v * aside_slope + u * along_slope
    result[:2, YAW_RATE] = turn @ by_rate
    return result


def process_noise(heading: float, dt: float, agility: Agility) -> Floats:
    """Return what driving on for `dt` seconds adds to the covariance, shape (7, 7)."""
    half = 0.5 * dt * dt
    cos, sin = math.cos(heading), math.sin(heading)
    ways = np.zeros((7, 3))
    ways[[X, Y, SPEED], 0] = half * cos, half * sin, dt
    ways[[HEADING, YAW_RATE], 1] = half, dt
    ways[[X, Y, SLIDE], 2] = -half * sin, half * cos, dt
    deviations = np.array([agility.acceleration, agility.yaw_acceleration, agility.slide])
    result: Floats = (ways * deviations**2) @ ways.T
    result[BIAS, BIAS] += agility.bias_drift**2 * dt
    return result


def antenna_at(state: Floats, lever: float) -> Floats:
    """Return the place of an antenna `lever` [m] ahead of the rear axle, shape (2,)."""
    heading = state[HEADING]
    return np.array([state[X] + lever * math.cos(heading), state[Y] + lever * math.sin(heading)])


def antenna_jacobian(state: Floats, lever: float) -> Floats:
    """Return the derivative of `antenna_at` by the state, shape (2, 7)."""
    result = np.zeros((2, 7))
    result[0, X] = result[1, Y] = 1.0
    result[0, HEADING] = -lever * math.sin(state[HEADING])
    result[1, HEADING] = lever * math.cos(state[HEADING])
    return result


def wrap(angle: float) -> float:
    """Return an angle [rad] moved by whole turns into [-pi, pi]."""
    return math.remainder(angle, 2.0 * math.pi)


class KartFilter:
    """The filter. `predict` to the time of a reading, then hand in the reading."""

    def __init__(
        self, x: float, y: float, heading: float, *, lever: float, agility: Agility | None = None
    ) -> None:
        """Begin at rest, the antenna at (x, y); the heading is known to about 20 degrees."""
        self._lever = lever
        self._agility = agility or Agility()
        back_x, back_y = x - lever * math.cos(heading), y - lever * math.sin(heading)
        self.state: Floats = np.array([back_x, back_y, heading, 0.0, 0.0, 0.0, 0.0])
        self.covariance: Floats = np.diag([1.0, 1.0, ROUGH, 0.25, 0.25, 2.5e-3, 0.01])
        self._refused: dict[str, int] = {}  # readings in a row that were not believed

    def predict(
        self, dt: float, *, push: tuple[float, float] = (0.0, 0.0), blow: float = 0.0
    ) -> None:
        """Drive on for `dt` seconds.

        push: accelerations [m/s²] of the speeds ahead and aside, as they were felt; blow: [m/s²]
        that no tyre can have caused. A kart that is hit may move where its body does not point, at
        up to the speed that it had.
        """
        if dt <= 0.0:
            return
        slope = jacobian_of(self.state, dt)
        noise = process_noise(float(self.state[HEADING]), dt, self._agility)
        felt = np.array(push) * dt
        self.state[[SPEED, SLIDE]] += 0.5 * felt
        self.state = drive_on(self.state, dt)
        self.state[[SPEED, SLIDE]] += 0.5 * felt
        self.state[HEADING] = wrap(float(self.state[HEADING]))
        self.covariance = slope @ self.covariance @ slope.T + noise
        if blow > 0.0:
            speed = abs(float(self.state[SPEED])) + blow * dt
            slid, turned = speed * speed * SLIDE_S * dt, (blow * dt) ** 2
            self.covariance += np.diag([slid, slid, 0.0, turned, 0.0, 0.0, 0.0])

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

    def see_grip(self, deviation: float) -> None:
        """Assume that the tyres hold, unless the kart clearly slides. deviation: [m/s] aside."""
        square = float(self.covariance[SLIDE, SLIDE]) + deviation**2
        if self.state[SLIDE] ** 2 < PLAIN * square:
            self._see_one("grip", -float(self.state[SLIDE]), (SLIDE,), deviation)

    def _see_one(
        self, sensor: str, residual: float, columns: tuple[int, ...], deviation: float
    ) -> bool:
        slope = np.zeros((1, 7))
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
        keep = np.eye(len(self.state)) - gain @ slope
        self.covariance = keep @ self.covariance @ keep.T + gain @ noise @ gain.T
        return True

    def _doubt(self, sensor: str, residual: Floats, slope: Floats) -> None:
        """Count a refusal; after too many in a row doubt the state by as much as it misses.

        But not the gyro's bias, which drifts and never jumps. A filter with a wrong position has a
        wrong heading too, by an unknown amount: it must not be made to explain the position.
        """
        self._refused[sensor] = self._refused.get(sensor, 0) + 1
        if self._refused[sensor] > (MOST_FIXES_REFUSED if sensor == "position" else MOST_REFUSED):
            self._refused[sensor] = 0
            slope = slope.copy()
            slope[:, [HEADING, BIAS]] = 0.0
            self.covariance = self.covariance + slope.T @ np.diag(residual**2) @ slope
            if sensor == "position":
                self.covariance += np.diag([0.0, 0.0, ROUGH, 0.0, 0.0, 0.0, UNNOTICED])

    @property
    def deviation(self) -> float:
        """Standard deviation [m] of the position, in its worse direction at most."""
        return math.sqrt(float(self.covariance[X, X] + self.covariance[Y, Y]))
