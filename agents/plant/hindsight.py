"""How a moment in a race ended, by the true places: was the way blocked, did it get close."""

import math
from collections.abc import Sequence

import numpy as np

from race_agents.plant.gaps import gap_between
from race_agents.plant.raced import SCAN_S, Frame
from race_agents.plant.radar import Floats, Surroundings, outlines_of
from race_agents.unit.limits import Limits
from race_agents.unit.safety import way_along
from race_server.core.messages import Status
from race_server.core.vehicles import GRAVITY, Vehicle
from race_server.net.wire.spectate import Rows

# The end of a danger is looked at until this time [s] after it would be met, and for some time
# [s] at least and at most. A kart came close to another one nearer than `CLOSE`, to a
# border nearer than `GRAZE` [m].
AFTER_S, SOON_S, LATEST_S = 0.5, 1.5, 3.0
CLOSE, GRAZE = 0.35, 0.1
# A speed that changes by more than this between two snapshots is that of a collision [m/s].
BLOW = 2.0
# A kart that drives slower by this [m/s] is in the way of one that has to stop or wait for it,
# within the way to stop and a warning before that [s], and this much room beside [m].
# One slower than `STILL` [m/s] is in the way of any.
SLOWER, STILL, BEFORE_S, ROOM = 3.0, 1.0, 1.0, 0.3
FORESEEN_S = 2.0  # [s] for which karts are taken to go on as they do
SLOW = 2.0  # [m/s] slower than this a kart is not raced


def rows_of(karts: Rows) -> Floats:
    """Return x, y, heading and velocity of karts, (n, 5)."""
    cos, sin = np.cos(karts["heading"]), np.sin(karts["heading"])
    vx = karts["speed"] * cos - karts["lateral_speed"] * sin
    vy = karts["speed"] * sin + karts["lateral_speed"] * cos
    return np.stack([karts["x"], karts["y"], karts["heading"], vx, vy], axis=1).astype(np.float64)


def was_blocked(frames: Sequence[Frame], seat: int, vehicle: Vehicle, limits: Limits) -> bool:
    """Return whether a kart's way was blocked in the first frame, or by when its brakes bite."""
    for frame in frames[: round(limits.reaction_s / SCAN_S) + 1]:
        racing = frame.karts[frame.karts["status"] == Status.RACING]
        own = racing["seat"] == seat
        if own.any() and is_blocked(racing[own][0], rows_of(racing[~own]), vehicle, limits):
            return True
    return False


def is_blocked(row: np.void, others: Floats, vehicle: Vehicle, limits: Limits) -> bool:
    """Return whether another kart truly is in the way of this one, or gets there as it goes on.

    If this one goes on along its arc and the other one straight on, they touch; or a slower one is
    on that arc within the way to stop, now or in a moment. A kart that turns faster than its tyres
    hold slides, and its arc is as tight as they hold. others: (n, 5) as of `rows_of`.
    """
    speed = float(row["speed"])
    heading = float(row["heading"]) + math.atan2(float(row["lateral_speed"]), max(speed, SLOW))
    cos, sin = math.cos(heading), math.sin(heading)
    most = vehicle.grip * GRAVITY / max(speed, SLOW) ** 2
    curvature = max(-most, min(float(row["yaw_rate"]) / max(speed, SLOW), most))

    def on_arc(seconds: float) -> tuple[Floats, Floats]:
        dx = others[:, 0] + others[:, 3] * seconds - float(row["x"])
        dy = others[:, 1] + others[:, 4] * seconds - float(row["y"])
        return way_along(dx * cos + dy * sin, dy * cos - dx * sin, curvature)

    along, _ = on_arc(0.0)
    ways = heading + curvature * along
    paces = others[:, 3] * np.cos(ways) + others[:, 4] * np.sin(ways)
    is_ahead, is_slower = along > 0.0, paces < max(speed - SLOWER, STILL)
    stop = speed * (limits.reaction_s + BEFORE_S) + speed**2 / (2.0 * limits.braking)
    beside = 0.5 * (vehicle.length + vehicle.width) + ROOM
    is_met = np.zeros(len(others), np.bool_)
    for seconds in np.arange(0.0, FORESEEN_S, SCAN_S):
        then, aside = on_arc(float(seconds))
        gap = then - speed * seconds
        reached = (gap > -vehicle.length) & (gap < stop + vehicle.length)
        is_met |= is_slower & (np.abs(aside) < beside) & reached
        is_met |= (np.abs(aside) < vehicle.width) & (np.abs(gap) < vehicle.length)
    return bool((is_ahead & is_met).any())


def came_close(frames: Sequence[Frame], seat: int, vehicle: Vehicle, borders: Floats) -> bool:
    """Return whether a kart touched or nearly touched another one, or a border, in some frames."""
    around, speed = Surroundings(borders), math.nan
    for frame in frames:
        karts = frame.karts
        own = karts[karts["seat"] == seat]
        if not len(own):
            return False
        before, speed = speed, float(own["speed"][0])
        if abs(speed - before) > BLOW:
            return True
        x, y, heading = (float(own[name][0]) for name in ("x", "y", "heading"))
        body, reach = outlines_of(np.array([[x, y, heading]]), vehicle), 2.0 * vehicle.length
        for row in rows_of(karts[karts["seat"] != seat]):
            if math.hypot(row[0] - x, row[1] - y) < reach:
                other = outlines_of(row[None], vehicle)
                if gap_between(body, other) < CLOSE:
                    return True
        near = around.borders_near(x, y, reach)
        if len(near) and gap_between(body, near) < GRAZE:
            return True
    return False
