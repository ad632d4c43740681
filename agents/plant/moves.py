"""How the target of a meeting moves, by the time to the meeting [s], which is at x = 0.

Each returns x, y [m] and the velocity [m/s]; `race_agents.plant.encounter` says what meets it.
"""

import math

Where = tuple[float, float, float, float]


def crosses(until_s: float, *, pace: float, side: float, at: float, x: float) -> Where:
    """Return who goes across. side: -1 from the right; at: y at the meeting [m]."""
    return x, at + side * pace * until_s, 0.0, -side * pace


def goes_ahead(until_s: float, *, pace: float, at: float, x: float) -> Where:
    """Return who goes the same way, or stands. at: y [m]; x: at the meeting [m]."""
    return x - pace * until_s, at, pace, 0.0


def brakes(until_s: float, *, speed: float, length: float, follows: float, braking: float) -> Where:
    """Return a kart that drives ahead and brakes until it stands, from 3 s before the meeting on.

    follows: how far ahead of the bumper it drives [m]; braking: [m/s²].
    """
    since = max(3.0 - until_s, 0.0)
    least = min(since, speed / braking)
    way = speed * min(4.0 - until_s, 1.0) + speed * least - 0.5 * braking * least**2
    start = -speed * 4.0 + follows + 0.5 * length
    return start + way, 0.0, max(speed - braking * since, 0.0), 0.0


def leaves(
    until_s: float, *, speed: float, length: float, follows: float, aside: float, over_s: float
) -> Where:
    """Return a kart that drives ahead and leaves the way to the left before what stands there.

    follows: how far ahead of the bumper it drives [m]; aside: how far to the left it goes [m],
    within over_s [s], until its bumper is at the meeting.
    """
    x = follows + 0.5 * length - speed * until_s
    ends_s = (follows + length) / max(speed, 1e-6)  # before the meeting
    share = min(max((ends_s + over_s - until_s) / over_s, 0.0), 1.0)
    # Half a wave: it begins and ends along the way.
    y = 0.5 * aside * (1.0 - math.cos(math.pi * share))
    is_turning = 0.0 < share < 1.0
    vy = 0.5 * aside * math.pi / over_s * math.sin(math.pi * share) if is_turning else 0.0
    return x, y, speed, vy
