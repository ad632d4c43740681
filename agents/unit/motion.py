"""How a kart moves on between two readings: state, motion, its derivative, process noise."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from race_server.core.messages import Pose
from race_server.core.vehicles import GRAVITY, Vehicle

Floats = NDArray[np.float64]

# Place of the rear axle's middle [m], heading [rad], speed ahead [m/s], yaw rate [rad/s], the
# gyro's bias [rad/s], the speed at which the rear axle slides to the left [m/s]; the wheels' error
# of scale [-], the tyres' compliance (slip angle per acceleration across) [s²/m], and the delay of
# position fixes that carry no stamp [s].
X, Y, HEADING, SPEED, YAW_RATE, BIAS, SLIDE, SCALE, COMPLIANCE, DELAY = range(10)
SIZE = 10
PLACE = 3  # the first of them: where a kart is, and where it points
# [√s] of a yaw acceleration at which one axle holds and the other does not.
TURNS = 0.02
IDENTITY = np.eye(SIZE)
STRAIGHT = 1e-4  # [rad/s] turns slower than this are driven as straight lines


@dataclass(frozen=True)
class Agility:
    """How far a kart departs from what is expected: deviations that grow with √time."""

    acceleration: float = 0.42  # [m/s in √s] without an accelerometer
    felt: float = 0.06  # [m/s in √s] with one
    yaw_acceleration: float = 0.35  # [rad/s in √s] of a small and nimble vehicle
    slide: float = 0.2  # [m/s in √s] to the side, beside what an accelerometer feels
    bias_drift: float = 1e-3  # [rad/s in √s] of the gyro
    scale_drift: float = 1e-4  # [1/√s] of the wheels' circumference
    compliance_drift: float = 1e-4  # [s²/m in √s] of the tyres
    delay_drift: float = 1e-4  # [s in √s]

    @classmethod
    def of(cls, vehicle: Vehicle) -> "Agility":
        """Return the agility of a vehicle: what is short turns faster."""
        return cls(yaw_acceleration=TURNS * vehicle.grip * GRAVITY / vehicle.wheelbase)

    def noise(self, *, feels: bool) -> Floats:
        """Return what a second adds to the covariance, shape (10, 10), diagonal.

        feels: whether an accelerometer tells how the speed changes. Half of a step's comes before
        the kart drives on and half after it: so it reaches the place as white noise does, but for
        terms of the third order in the step's time.
        """
        variances = np.zeros(SIZE)
        variances[SPEED] = (self.felt if feels else self.acceleration) ** 2
        variances[YAW_RATE], variances[SLIDE] = self.yaw_acceleration**2, self.slide**2
        variances[BIAS], variances[SCALE] = self.bias_drift**2, self.scale_drift**2
        variances[COMPLIANCE], variances[DELAY] = self.compliance_drift**2, self.delay_drift**2
        return np.diag(variances)


def drive_on(state: Floats, dt: float, push: tuple[float, float] = (0.0, 0.0)) -> Floats:
    """Return the state `dt` seconds later at one turn rate.

    push: how the speeds ahead and to the left change [m/s²]; half of it before the way is driven.
    """
    x, y, heading, speed, rate, _, slide, *_ = state.tolist()
    faster, wider = 0.5 * dt * push[0], 0.5 * dt * push[1]
    speed, slide = speed + faster, slide + wider
    along, aside = arc(rate, dt)
    cos, sin = math.cos(heading), math.sin(heading)
    ahead, left = speed * along - slide * aside, speed * aside + slide * along
    result = state.copy()
    result[X] = x + ahead * cos - left * sin
    result[Y] = y + ahead * sin + left * cos
    result[HEADING] = wrap(heading + rate * dt)
    result[SPEED], result[SLIDE] = speed + faster, slide + wider
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
    """Return the derivative of `drive_on` by the state, shape (10, 10)."""
    _, _, heading, v, rate, _, u, *_ = state.tolist()
    along, aside = arc(rate, dt)
    along_slope, aside_slope = arc_slope(rate, dt)
    ahead, left = v * along - u * aside, v * aside + u * along
    ahead_by_rate, left_by_rate = (
        v * along_slope - u * aside_slope,
        v * aside_slope + u * along_slope,
    )
    cos, sin = math.cos(heading), math.sin(heading)
    result = IDENTITY.copy()
    result[HEADING, YAW_RATE] = dt
    result[X, HEADING] = -left * cos - ahead * sin
    result[Y, HEADING] = ahead * cos - left * sin
    result[X, SPEED] = along * cos - aside * sin
    result[Y, SPEED] = along * sin + aside * cos
    result[X, SLIDE] = -aside * cos - along * sin
    result[Y, SLIDE] = along * cos - aside * sin
    result[X, YAW_RATE] = ahead_by_rate * cos - left_by_rate * sin
    result[Y, YAW_RATE] = ahead_by_rate * sin + left_by_rate * cos
    return result


def antenna_at(state: Floats, lever: float) -> Floats:
    """Return the place of an antenna `lever` [m] ahead of the rear axle, shape (2,)."""
    heading = state[HEADING]
    return np.array([state[X] + lever * math.cos(heading), state[Y] + lever * math.sin(heading)])


def antenna_jacobian(state: Floats, lever: float) -> Floats:
    """Return the derivative of `antenna_at` by the state, shape (2, 10)."""
    result = np.zeros((2, SIZE))
    result[0, X] = result[1, Y] = 1.0
    result[0, HEADING] = -lever * math.sin(state[HEADING])
    result[1, HEADING] = lever * math.cos(state[HEADING])
    return result


def velocity_of(state: Floats, lever: float) -> Floats:
    """Return the velocity [m/s] of the antenna, east and north, shape (2,)."""
    cos, sin = math.cos(state[HEADING]), math.sin(state[HEADING])
    left = state[SLIDE] + lever * state[YAW_RATE]
    return np.array([state[SPEED] * cos - left * sin, state[SPEED] * sin + left * cos])


def acceleration_of(state: Floats, push: tuple[float, float], lever: float) -> Floats:
    """Return how the velocity of the antenna changes [m/s²], east and north, shape (2,).

    push: how the speeds of the rear axle ahead and to the left do [m/s²]; the kart is taken to turn
    at one rate.
    """
    cos, sin, rate = math.cos(state[HEADING]), math.sin(state[HEADING]), state[YAW_RATE]
    ahead, left = push[0] - (state[SLIDE] + lever * rate) * rate, push[1] + state[SPEED] * rate
    return np.array([ahead * cos - left * sin, ahead * sin + left * cos])


def velocity_jacobian(state: Floats, lever: float) -> Floats:
    """Return the derivative of `velocity_of` by the state, shape (2, 10)."""
    cos, sin = math.cos(state[HEADING]), math.sin(state[HEADING])
    east, north = velocity_of(state, lever)
    result = np.zeros((2, SIZE))
    result[:, HEADING] = -north, east
    result[:, SPEED] = cos, sin
    result[:, SLIDE] = -sin, cos
    result[:, YAW_RATE] = -lever * sin, lever * cos
    return result


def wrap(angle: float) -> float:
    """Return an angle [rad] moved by whole turns into [-pi, pi]."""
    return math.remainder(angle, 2.0 * math.pi)


def pose_of(state: Floats, vehicle: Vehicle, stands: float) -> Pose:
    """Return where a state says that the kart's centre of gravity is.

    A kart slower than `stands` [m/s] stands: what its sensors say is noise, which would count as
    changes of direction.
    """
    numbers = state.tolist()
    heading, back = numbers[HEADING], vehicle.rear_axle
    speed, slide, turn = numbers[SPEED], numbers[SLIDE], numbers[YAW_RATE]
    if abs(speed) < stands:
        speed = slide = turn = 0.0
    return Pose(
        stamp_us=0,
        x=numbers[X] + back * math.cos(heading),
        y=numbers[Y] + back * math.sin(heading),
        heading=heading,
        speed=speed,
        lateral_speed=slide + back * turn,
        yaw_rate=turn,
    )
