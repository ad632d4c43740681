"""What a lap would have been: driven like one lap up to a place, and like another from there.

Each lap keeps its own speeds but near the joint. There the vehicle's limits say how long speed that
is carried over, or lacks, lasts: passes forward and backward as in
`scenario/raceline/profile.py`, over the part of the lap that changes.
"""

import math
from functools import lru_cache

import numpy as np

from race_server.coaching.lap import Lap
from race_server.scenario.raceline.bounds import SLOWEST, Bounds
from race_server.scenario.raceline.profile import braking, driving
from race_server.scenario.raceline.result import COASTING

# A throttle further open than this is full.
FULL = 0.9
# A brake pedal pressed further than this brakes.
PRESSED = 0.05
# Speeds this close [m/s] are the same.
SAME = 1e-9
# The hardest braking of a lap is what it exceeds in this share of its points.
HARDEST = 0.01
# Laps that are remembered as the passes read them.
MOST_MOTIONS = 64


class Motion:
    """A lap as the passes read it."""

    def __init__(self, lap: Lap, bounds: Bounds) -> None:
        ways, speed = np.maximum(lap.ways, 1e-6), np.maximum(lap.speed, SLOWEST)
        pull = np.diff(speed**2) / (2.0 * ways)
        powered = (pull > COASTING) | (lap.throttle[:-1] > FULL)
        powered &= lap.brake[:-1] < PRESSED
        self.bounds = bounds
        self.ways: list[float] = ways.tolist()
        self.speed: list[float] = speed.tolist()
        self.curvature: list[float] = lap.curvature.tolist()
        self.pull: list[float] = pull.tolist()  # [m/s²]
        # Where the driver wants more speed, and would have kept what he was given.
        self.powered: list[bool] = [*powered.tolist(), False]
        self.hardest = max(float(np.quantile(-pull, 1.0 - HARDEST)), COASTING)  # [m/s²]
        self.time: list[float] = lap.time.tolist()
        self._could: dict[int, float] = {}  # acceleration [m/s²] at its speed, by point

    def slowing(self, index: int, speed: float) -> float:
        """Return how hard [m/s²] its driver slows down at a point at a speed [m/s]."""
        return min(braking(speed, self.curvature[index], self.bounds), self.hardest)

    def ceiling(self, at: int) -> list[float]:
        """Return the most speeds [m/s] from a point to where the driver leaves the throttle.

        There he has the speed that he had, however fast he came: he brakes for it in time.
        """
        end = at
        while self.powered[end]:
            end += 1
        most = [self.speed[end]]
        for index in range(end - 1, at - 1, -1):
            loss = 2.0 * self.ways[index] * self.slowing(index, most[-1])
            most.append(min(math.sqrt(most[-1] ** 2 + loss), self.bounds.top_speed))
        return most[::-1]

    def going_on(self, index: int, speed: float) -> float:
        """Return the acceleration [m/s²] at a point for a driver with another speed there.

        On the throttle he keeps it where it was, and what the vehicle has left at this speed makes
        the difference; elsewhere he lacks speed, and takes what the vehicle has.
        """
        could = driving(speed, self.curvature[index], self.bounds)
        if not self.powered[index]:
            return could
        own = self._could.get(index)
        if own is None:
            own = driving(self.speed[index], self.curvature[index], self.bounds)
            self._could[index] = own
        return self.pull[index] + could - own


@lru_cache(maxsize=MOST_MOTIONS)
def motion_of(lap: Lap, bounds: Bounds) -> Motion:
    """Return a lap as the passes read it; laps are compared with the same ones again and again."""
    return Motion(lap, bounds)


def joined_time(before: Motion, after: Motion, at: int) -> float:
    """Return the time [s] of a lap driven as one lap before a point, and as another from there."""
    time = before.time[at] + after.time[-1] - after.time[at]
    arriving, most = before.speed[at], after.ceiling(at)
    time += _carried_on(after, at, min(arriving, most[0]), most)
    if arriving > most[0]:
        time += _slowed_before(before, at, most[0])
    return time


def _carried_on(lap: Motion, at: int, speed: float, most: list[float]) -> float:
    """Return how much longer [s] a lap takes that passes a point at another speed [m/s]."""
    longer, last = 0.0, len(lap.ways)
    for index in range(at, last):
        own, own_next = lap.speed[index], lap.speed[index + 1]
        if abs(speed - own) < SAME:
            break
        gain = 2.0 * lap.ways[index] * lap.going_on(index, speed)
        following = math.sqrt(max(speed * speed + gain, SLOWEST**2))
        if speed > own:
            allowed = most[index + 1 - at] if index + 1 - at < len(most) else own_next
            following = max(min(following, allowed), own_next)
        else:
            following = min(following, own_next)
        longer += 2.0 * lap.ways[index] * (1.0 / (speed + following) - 1.0 / (own + own_next))
        speed = following
    return longer


def _slowed_before(lap: Motion, at: int, speed: float) -> float:
    """Return how much longer [s] a lap takes that has to be slower [m/s] at a point."""
    longer = 0.0
    for index in range(at - 1, -1, -1):
        own, own_next = lap.speed[index], lap.speed[index + 1]
        loss = 2.0 * lap.ways[index] * lap.slowing(index, speed)
        earlier = min(math.sqrt(speed * speed + loss), own)
        longer += 2.0 * lap.ways[index] * (1.0 / (earlier + speed) - 1.0 / (own + own_next))
        speed = earlier
        if own - speed < SAME:
            break
    return longer
