"""A line turns from one side to the other as fast as a body can follow, or it is slower there."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from race_server.scenario.raceline.bounds import SLOWEST, Bounds
from race_server.scenario.raceline.profile import braking, driving
from race_server.scenario.track.course import Floats

Pull = Callable[[float, float, Bounds], float]

# Times that a body takes to turn until it follows another curvature, and how far [body widths] it
# may go astray meanwhile.
LAGS, ASTRAY_WIDTHS = 2.0, 0.16
# How far [times the grip] the acceleration across may change meanwhile, of 2 from one side's limit
# to that of the other, where the body lags for less than QUICK_S [s], three decisions of a driver:
# the tyres' slip turns over as well, which is noticed only afterwards, and a body that has gone
# astray until then needs some grip to come back.
TURN_OVER, QUICK_S = 1.5, 0.15


def swiftness(turning: Any, speed: Any, known: Floats, bounds: Bounds) -> list[Any]:
    """Return how fast the curvature changes, as shares (N,) [-] of what a body follows.

    turning: (N,) rate of the curvature [1/(m s)]; speed: (N,) [m/s]; both may be unknowns of a
    program; known: (N,) about that speed, by which it is decided where the change is quick. The
    rules are those of `followed`, with the change of the curvature within the lag.
    """
    lag = LAGS * bounds.lag
    if lag == 0.0:
        return []
    shares = [turning * speed**5 * (lag**3 / (8.0 * ASTRAY_WIDTHS * bounds.width))]
    is_quick = lag * known < QUICK_S
    if is_quick.any():
        shares.append(turning * speed**3 * (is_quick * lag / (TURN_OVER * bounds.lateral)))
    return shares


def followed(speed: Floats, curvature: Floats, spacing: float, bounds: Bounds) -> Floats:
    """Return the most speed (N,) [m/s] at which a body follows a closed line as it turns over.

    speed, curvature: (N,) of the line [m/s], [1/m]; spacing: [m] between its samples. The yaw rate
    follows the steering with the time constant v I / (C a b), with the yaw inertia I, the
    stiffness C of all tyres [N/rad] and the axles' distances a and b from the centre of gravity.
    While it lags, for LAGS of these times T, the body goes astray by the change of the curvature
    within them, v² Δk T² / 8. If that is quick, v² Δk is at most TURN_OVER times the
    grip.
    """
    lag = LAGS * bounds.lag
    places = np.arange(len(speed))
    ahead = (places + lag * speed**2 / spacing) % len(speed)
    change = np.abs(np.interp(ahead, places, curvature, period=len(speed)) - curvature)
    change = np.maximum(change, 1e-9)
    # Squares of speeds.
    follows = np.sqrt(8.0 * ASTRAY_WIDTHS * bounds.width / change) / max(lag, 1e-9)
    is_quick = lag * speed < QUICK_S
    steady = np.where(is_quick, TURN_OVER * bounds.lateral / change, np.inf)
    return np.asarray(np.sqrt(np.minimum(follows, steady)))


def slowed(speed: Floats, curvature: Floats, spacing: float, bounds: Bounds) -> Floats:
    """Return the speeds (N,) [m/s] of a line that a body can follow where it turns over.

    Before such a place it brakes as hard as the bend leaves grip for, and behind it it accelerates
    as hard, until it is as fast as before.
    """
    most = followed(speed, curvature, spacing, bounds)
    speeds, curves = np.minimum(speed, most).tolist(), curvature.tolist()
    for place in np.flatnonzero(most < speed).tolist():
        for pull, step in (braking, -1), (driving, 1):
            here, there = place, (place + step) % len(speeds)
            while (now := _after(speeds[here], curves[here], spacing, pull, bounds)) < speeds[
                there
            ]:
                speeds[there] = now
                here, there = there, (there + step) % len(speeds)
    return np.array(speeds)


def _after(speed: float, curvature: float, way: float, pull: Pull, bounds: Bounds) -> float:
    """Return the speed [m/s] that is reached on a way [m]. pull: the acceleration [m/s²]."""
    square = speed * speed + 2.0 * way * pull(speed, curvature, bounds)
    return max(math.sqrt(max(square, 0.0)), SLOWEST)
