"""The fastest speeds along a given line: one pass forward and one backward, twice round."""

import math

import numpy as np

from race_server.scenario.raceline.bounds import SLOWEST, Bounds
from race_server.scenario.raceline.tyres import cornering_drag, front_effort
from race_server.scenario.track.course import Floats

# The best force of the motor is found to this share of the most.
_NEAR = 0.02


def grip_left(speed: float, curvature: float, bounds: Bounds) -> float:
    """Return the share of the longitudinal grip that is left beside the lateral force [-]."""
    used = speed * speed * abs(curvature) * front_effort(curvature, bounds) / bounds.lateral
    return math.sqrt(max(1.0 - used * used, 0.0))


def driving(speed: float, curvature: float, bounds: Bounds) -> float:
    """Return the most acceleration [m/s²] at a speed [m/s] in a bend [1/m], losses taken off.

    It is less than zero where the bend alone costs more than the motor has. Near the grip's limit
    slip grows faster than what the motor adds, so the best force is looked for.
    """
    motor = min(bounds.drive, bounds.power / speed)
    most = min(motor, bounds.drive_grip * grip_left(speed, curvature, bounds))

    def gain(force: float) -> float:
        return force - cornering_drag(speed, curvature, force, bounds)

    low, high = 0.0, most
    if gain(most) < gain((1.0 - _NEAR) * most):
        while high - low > _NEAR * most:
            third = (high - low) / 3.0
            if gain(low + third) < gain(high - third):
                low += third
            else:
                high -= third
    return gain(high) - bounds.rolling - bounds.drag * speed * speed


def braking(speed: float, curvature: float, bounds: Bounds) -> float:
    """Return the most deceleration [m/s²] at a speed [m/s] in a bend [1/m]."""
    force = min(bounds.brake, bounds.brake_grip * grip_left(speed, curvature, bounds))
    slip = cornering_drag(speed, curvature, -force, bounds)
    return force + bounds.rolling + bounds.drag * speed * speed + slip


def speeds_on(lengths: Floats, curvature: Floats, bounds: Bounds) -> Floats:
    """Return the speeds (N,) [m/s] of the fastest flying lap along a closed line.

    lengths: (N,) from each station to the next [m]; curvature: (N,) [1/m]. No station is passed
    faster than its bend allows; between stations the rest of the grip accelerates or brakes
    (for example Heilmeier et al., Minimum curvature trajectory planning, 2019, section 3.2).
    """
    steps, curves = lengths.tolist(), curvature.tolist()
    tightness = [max(abs(curve) * front_effort(curve, bounds), 1e-9) for curve in curves]
    bends = np.sqrt(bounds.lateral / np.array(tightness))
    speeds = np.maximum(np.minimum(bends, bounds.top_speed), SLOWEST).tolist()
    # Begin at the slowest station, at the speed that a lap before leaves there: a bend that never
    # ends slows down by the drag of its tyres. The second time round takes in what the first
    # changed.
    start = int(np.argmin(speeds))
    before = speeds.copy()
    _drive_on(before, steps, curves, start, bounds)
    speeds[start] = before[start]
    for _ in range(2):
        _drive_on(speeds, steps, curves, start, bounds)
        _brake_before(speeds, steps, curves, start, bounds)
    return np.array(speeds)


def _drive_on(
    speeds: list[float], steps: list[float], curves: list[float], start: int, bounds: Bounds
) -> None:
    """Lower speeds [m/s] to what can be reached from the station before, once round."""
    count = len(speeds)
    for index in range(start, start + count):
        here, there = index % count, (index + 1) % count
        gain = 2.0 * steps[here] * driving(speeds[here], curves[here], bounds)
        reached = math.sqrt(max(speeds[here] ** 2 + gain, SLOWEST**2))
        speeds[there] = min(speeds[there], reached)


def _brake_before(
    speeds: list[float], steps: list[float], curves: list[float], start: int, bounds: Bounds
) -> None:
    """Lower speeds [m/s] to those from which the next station's can be reached, once round."""
    count = len(speeds)
    for index in range(start + count, start, -1):
        there, here = index % count, (index - 1) % count
        loss = 2.0 * steps[here] * braking(speeds[there], curves[there], bounds)
        speeds[here] = min(speeds[here], math.sqrt(speeds[there] ** 2 + loss))


def lap_time(lengths: Floats, speeds: Floats) -> float:
    """Return the time [s] of a closed lap with constant acceleration between stations."""
    return float(np.sum(2.0 * lengths / (speeds + np.roll(speeds, -1))))
