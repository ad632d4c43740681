"""Driving faults on purpose: the reference line as a driver with a fault follows it."""

from dataclasses import dataclass, replace

import numpy as np

from race_server.coaching.corners import Corner
from race_server.coaching.faults import FaultKind
from race_server.coaching.lap import Lap, progress_on
from race_server.core.state import Floats, Ints
from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.raceline.detour import shifted
from race_server.scenario.raceline.profile import driving
from race_server.scenario.track.course import Course
from race_server.scenario.track.line import ReferenceLine
from race_server.scenario.track.polyline import smooth

# Standard deviations [m] of filters: of what moves the line, and of random errors.
EVEN, EVEN_NOISE = 1.5, 10.0
# An offset that the road allows to less than this share is none.
ROOM = 0.7
# Sets random errors apart from other uses of a seed.
NOISE = 42


@dataclass(frozen=True)
class Habit:
    """One fault in one corner."""

    kind: FaultKind
    corner: Corner
    size: float  # in the unit of its kind


@dataclass(frozen=True, eq=False)
class Road:
    """The line of a course, and what is known of its samples (N,)."""

    course: Course
    line: ReferenceLine
    bounds: Bounds
    lap: Lap  # along the line
    progress: Floats  # [m] along the centre line

    def after(self, place: float) -> Floats:
        """Return how far (N,) [m] samples lie behind a place, from minus to plus half a lap."""
        length = self.course.length
        return np.asarray((self.progress - place + 0.5 * length) % length - 0.5 * length)

    def sample(self, place: float) -> int:
        """Return the sample at a progress [m]."""
        return int(np.argmin(np.abs(self.after(place))))


def road_of(course: Course, line: ReferenceLine, bounds: Bounds, lap: Lap) -> Road:
    """Return a line with the progress of its samples."""
    return Road(course, line, bounds, lap, progress_on(course, line) % course.length)


def line_with(road: Road, habit: Habit) -> ReferenceLine | None:
    """Return the line as a driver with a habit follows it; None where the road has no room."""
    if habit.kind in _ASIDE:
        offset = _ASIDE[habit.kind](road, habit.corner, habit.size)
        inside = np.abs(within(road, offset)).max()
        return moved(road, offset) if inside > ROOM * np.abs(offset).max() else None
    speed = _SPEEDS[habit.kind](road, habit.corner, habit.size)
    return replace(road.line, speed=speed)


def moved(road: Road, offset: Floats) -> ReferenceLine:
    """Return the line moved by offsets (N,) [m] to the left, as far as the road goes."""
    samples = EVEN / road.line.spacing
    return shifted(road.line, smooth(within(road, offset), samples), road.bounds)


def within(road: Road, offset: Floats) -> Floats:
    """Return offsets (N,) [m] as far as the road goes."""
    reach, line = road.bounds.reach, road.line
    low, high = np.minimum(reach - line.right, 0.0), np.maximum(line.left - reach, 0.0)
    return np.clip(offset, low, high)


def unsteady(road: Road, seed: int, wander: float = 0.12, uneven: float = 0.008) -> ReferenceLine:
    """Return the line as a driver follows it whose laps are never the same.

    wander: [m] standard deviation of the offset from the line; uneven: of the speed, as a share.
    """
    chance, count = np.random.default_rng([seed, NOISE]), len(road.line.x)

    def noise() -> Floats:
        white = chance.standard_normal(count)
        even = smooth(white, EVEN_NOISE / road.line.spacing)
        return np.asarray(even / even.std())

    line = moved(road, wander * noise())
    return replace(line, speed=line.speed * (1.0 + np.minimum(uneven * noise(), uneven)))


# Speeds (N,) [m/s]


def _early_brakes(road: Road, corner: Corner, size: float) -> Floats:
    """Be at each speed `size` [m] too early, and roll to the apex at the speed that it has."""
    speed = road.line.speed.copy()
    ahead = round(size / road.line.spacing)
    apex = road.sample(corner.apex)
    for index in _stretch(road, corner.begin, corner.apex):
        reach = min(ahead, (apex - index) % len(speed))
        speed[index] = road.line.speed[(index + np.arange(reach + 1)) % len(speed)].min()
    return speed


def _slow_bend(road: Road, corner: Corner, size: float) -> Floats:
    """Take the bend `size` [m/s] slower than at its apex it could be."""
    share = size / float(road.line.speed[road.sample(corner.apex)])
    reach = max(corner.apex - corner.entry, corner.exit - corner.apex)
    return road.line.speed * (1.0 - share * _bump(road, corner.apex, reach))


def _coasting(road: Road, corner: Corner, size: float) -> Floats:
    """Leave the throttle `size` [m] before the brakes."""
    return _rolled(road, corner.brake - size, size)


def _lift(road: Road, corner: Corner, size: float) -> Floats:
    """Leave the throttle for `size` [m] on the way out of the bend."""
    return _rolled(road, 0.4 * corner.apex + 0.6 * corner.exit, size)


def _rolled(road: Road, place: float, size: float) -> Floats:
    """Roll from a place on for `size` [m], then drive on with all the motor has."""
    line, bounds, speed = road.line, road.bounds, road.line.speed.copy()
    index, count = road.sample(place), len(speed)
    rolling, now = round(size / line.spacing), float(speed[index])
    for step in range(count - 1):
        pull = -bounds.rolling - bounds.drag * now * now
        if step >= rolling:
            pull = driving(now, float(line.curvature[index]), bounds)
        now = float(np.sqrt(max(now * now + 2.0 * line.spacing * pull, 1.0)))
        index = (index + 1) % count
        if step >= rolling and now >= speed[index]:
            break
        speed[index] = min(now, speed[index])
    return speed


def _late_throttle(road: Road, corner: Corner, size: float) -> Floats:
    """Accelerate out of the bend `size` [m] too late."""
    speed, count = road.line.speed.copy(), len(road.line.speed)
    apex, late = road.sample(corner.apex), round(size / road.line.spacing)
    for index in _stretch(road, corner.apex, corner.end):
        back = min(late, (index - apex) % count)
        speed[index] = min(speed[index], road.line.speed[(index - back) % count])
    return speed


def _stretch(road: Road, start: float, end: float) -> Ints:
    """Return the samples from one progress to another, in order."""
    first, last = road.sample(start), road.sample(end)
    count = len(road.line.speed)
    return (first + np.arange((last - first) % count + 1)) % count


# Offsets (N,) [m] to the left of the line


def _late_turn(road: Road, corner: Corner, size: float) -> Floats:
    """Move across the road `size` [m] too late, and make up for it by the apex."""
    lap, progress = road.lap, road.progress
    late = np.interp((progress - size) % road.course.length, lap.progress, lap.offset)
    missing = late - np.interp(progress, lap.progress, lap.offset)
    turning = corner.apex - corner.entry
    begun = road.after(corner.entry - 0.5 * turning) / (0.5 * turning)
    left = -road.after(corner.apex) / (0.5 * turning)
    fading = np.clip(np.minimum(begun, left), 0.0, 1.0)
    return np.asarray(missing * _eased(fading))


def _wide_apex(road: Road, corner: Corner, size: float) -> Floats:
    """Pass the apex `size` [m] further outside."""
    return -corner.side * size * _bump(road, corner.apex, 0.5 * (corner.exit - corner.entry))


def _short_exit(road: Road, corner: Corner, size: float) -> Floats:
    """Leave `size` [m] of the road unused at the exit."""
    return corner.side * size * _bump(road, corner.exit, corner.exit - corner.apex)


def _bump(road: Road, place: float, reach: float) -> Floats:
    return _eased(np.clip(1.0 - np.abs(road.after(place)) / reach, 0.0, 1.0))


def _eased(share: Floats) -> Floats:
    """Return shares that begin and end without a kink."""
    return np.asarray(share * share * (3.0 - 2.0 * share))


_SPEEDS = {
    FaultKind.EARLY_BRAKES: _early_brakes,
    FaultKind.SLOW_BEND: _slow_bend,
    FaultKind.COASTING: _coasting,
    FaultKind.LIFT: _lift,
    FaultKind.LATE_THROTTLE: _late_throttle,
}
_ASIDE = {
    FaultKind.LATE_TURN_IN: _late_turn,
    FaultKind.WIDE_APEX: _wide_apex,
    FaultKind.SHORT_EXIT: _short_exit,
}
