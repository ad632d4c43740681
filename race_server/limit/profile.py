"""The fastest speeds along a given line: one pass forward and one backward, twice round."""

import math

import numpy as np

from race_server.limit.bounds import SLOWEST, Bounds
from race_server.track.course import Floats


def grip_left(speed: float, curvature: float, bounds: Bounds) -> float:
    """Return the share of the longitudinal grip that is left beside the lateral force [-]."""
    used = speed * speed * abs(curvature) / bounds.lateral
    return math.sqrt(max(1.0 - used * used, 0.0))


def driving(speed: float, curvature: float, bounds: Bounds) -> float:
    """Return the most acceleration [m/s²] at a speed [m/s] in a bend [1/m], losses taken off."""
    motor = min(bounds.drive, bounds.power / speed)
    tyres = bounds.drive_grip * grip_left(speed, curvature, bounds)
    return min(motor, tyres) - bounds.rolling - bounds.drag * speed * speed


def braking(speed: float, curvature: float, bounds: Bounds) -> float:
    """Return the most deceleration [m/s²] at a speed [m/s] in a bend [1/m]."""
    tyres = bounds.brake_grip * grip_left(speed, curvature, bounds)
    return min(bounds.brake, tyres) + bounds.rolling + bounds.drag * speed * speed


def speeds_on(lengths: Floats, curvature: Floats, bounds: Bounds) -> Floats:
    """Return the speeds (N,) [m/s] of the fastest flying lap along a closed line.

    lengths: (N,) from each station to the next [m]; curvature: (N,) [1/m]. No station is passed
    faster than its bend allows; between stations the rest of the grip accelerates or brakes
    (for example Heilmeier et al., Minimum curvature trajectory planning, 2019, section 3.2).
    """
    count = len(lengths)
    bends = np.sqrt(bounds.lateral / np.maximum(np.abs(curvature), 1e-9))
    speeds = np.maximum(np.minimum(bends, bounds.top_speed), SLOWEST).tolist()
    steps, curves = lengths.tolist(), curvature.tolist()
    # The slowest station is never limited by its neighbours: begin there, and nothing is left
    # open where the lap closes. The second time round takes in what the first changed.
    start = int(np.argmin(speeds))
    for _ in range(2):
        for index in range(start, start + count):
            here, there = index % count, (index + 1) % count
            gain = 2.0 * steps[here] * driving(speeds[here], curves[here], bounds)
            reached = math.sqrt(max(speeds[here] ** 2 + gain, SLOWEST**2))
            speeds[there] = min(speeds[there], reached)
        for index in range(start + count, start, -1):
            there, here = index % count, (index - 1) % count
            loss = 2.0 * steps[here] * braking(speeds[there], curves[there], bounds)
            speeds[here] = min(speeds[here], math.sqrt(speeds[there] ** 2 + loss))
    return np.array(speeds)


def lap_time(lengths: Floats, speeds: Floats) -> float:
    """Return the time [s] of a closed lap with constant acceleration between stations."""
    return float(np.sum(2.0 * lengths / (speeds + np.roll(speeds, -1))))
