"""The corners of a course, found on a lap: where it slows down for a bend."""

from dataclasses import dataclass

import numpy as np

from race_server.coaching.lap import Lap
from race_server.scenario.track.course import Floats

# A corner is a place where the speed falls by this share at least and rises by it again. Bends that
# take less are part of the straight, and two slow places with less between them are one corner.
PROMINENCE = 0.03
# Speeds that differ by this share are the same: a long bend has its apex in the middle of them.
LEVEL = 0.002
# A bend begins and ends where the curvature is this share of the most that it has.
TURNED = 0.3
# A brake pedal pressed further than this brakes.
PRESSED = 0.05


@dataclass(frozen=True)
class Corner:
    """A corner, by progress along the course's centre line [m], in order of driving.

    Places before the timing line of a corner behind it are less than zero.
    """

    name: str  # T1 is the first after the timing line
    begin: float  # half-way down the straight before it: from here on it is being prepared
    brake: float  # where the lap begins to brake; the turn-in where it does not brake
    entry: float  # where it turns in
    apex: float  # where it is slowest
    exit: float  # where it has unwound the steering
    end: float  # where the next corner begins
    side: int  # 1 to the left, -1 to the right
    is_braked: bool = True  # False: the lap lifts at most

    @property
    def reach(self) -> float:
        """How far before the apex the lap begins to brake [m]."""
        return self.apex - self.brake


def corners_of(lap: Lap) -> tuple[Corner, ...]:
    """Return the corners of a course as a lap takes them, T1 first; none where it never slows.

    The lap is closed: its speed at the timing line is that of its end.
    """
    speed, curvature = lap.speed[:-1], lap.curvature[:-1]
    apexes = _apexes(speed)
    count = len(speed)
    spans = [
        _span(lap, apexes[row - 1] - count * (row == 0), at, following)
        for row, (at, following) in enumerate(
            zip(apexes, [*apexes[1:], *(apexes[:1] + count)], strict=True)
        )
    ]
    begins = []
    for row, (brake, entry, _) in enumerate(spans):
        lap_on = count * (row == 0)
        left, before = spans[row - 1][2] - lap_on, int(apexes[row - 1]) - lap_on
        begins.append(_between(speed, (left, min(brake, entry)), (before, int(apexes[row]))))
    ends = [*begins[1:], *(begin + count for begin in begins[:1])]
    return tuple(
        Corner(
            name=f"T{row + 1}",
            begin=begin * lap.step,
            brake=max(brake, begin) * lap.step,
            entry=max(entry, begin) * lap.step,
            apex=int(apexes[row]) * lap.step,
            exit=min(left, end) * lap.step,
            end=end * lap.step,
            side=1 if curvature[_tightest(curvature, entry, left) % count] > 0.0 else -1,
            is_braked=bool(lap.brake[brake % count] > PRESSED),
        )
        for row, ((brake, entry, left), begin, end) in enumerate(
            zip(spans, begins, ends, strict=True)
        )
    )


def _apexes(speed: Floats) -> np.ndarray:
    """Return the samples (n,) of a closed lap at which it is slowest in a corner, in order."""
    count, start = len(speed), int(np.argmax(speed))
    low = high = float(speed[start])
    at, falling, found = start, False, []
    for index in range(start, start + count + 1):
        here = float(speed[index % count])
        if falling:
            if here < low:
                low, at = here, index
            elif here > low * (1.0 + PROMINENCE):
                found.append(_middle(speed, at))
                falling, high = False, here
        elif here > high:
            high = here
        elif here * (1.0 + PROMINENCE) < high:
            falling, low, at = True, here, index
    return np.sort(np.array(found, np.int64) % count)


def _middle(speed: Floats, at: int) -> int:
    """Return the middle of the samples around `at` that are as slow."""
    count = len(speed)
    most = float(speed[at % count]) * (1.0 + LEVEL)
    first = last = at
    while speed[(first - 1) % count] <= most and last - first < count:
        first -= 1
    while speed[(last + 1) % count] <= most and last - first < count:
        last += 1
    return (first + last) // 2


def _span(lap: Lap, before: int, apex: int, after: int) -> tuple[int, int, int]:
    """Return the samples at which a corner is braked for, turned into and left.

    before, after: the apexes of its neighbours; the bend ends nearer to this one.
    """
    curvature, brake, count = lap.curvature[:-1], lap.brake[:-1], len(lap.speed) - 1
    first, last = (before + apex) // 2, (apex + after) // 2
    bend = _tightest(curvature, first + (apex - first) // 2, apex + (last - apex) // 2)
    least = TURNED * curvature[bend % count]

    def is_turned(index: int) -> bool:
        return bool(curvature[index % count] * np.sign(least) >= abs(least))

    entry = exit_ = bend
    while entry > first and is_turned(entry - 1):
        entry -= 1
    while exit_ < last and is_turned(exit_ + 1):
        exit_ += 1
    pressed = apex
    for index in range(apex, before, -1):
        if brake[index % count] > PRESSED:
            pressed = index
        elif pressed < apex:
            break
    entry = min(entry, apex)
    return (pressed if pressed < apex else entry), entry, max(exit_, apex)


def _tightest(curvature: Floats, first: int, last: int) -> int:
    """Return the sample with the most curvature from `first` to `last`, which may be over a lap."""
    indices = np.arange(first, last + 1)
    return int(indices[np.argmax(np.abs(curvature[indices % len(curvature)]))])


def _between(speed: Floats, straight: tuple[int, int], apexes: tuple[int, int]) -> int:
    """Return where one corner ends and the next begins.

    That is half-way down the straight from the exit of one to the brakes or the turn-in of the
    next; without a straight, where the lap is fastest between their apexes.
    """
    if straight[0] < straight[1]:
        return sum(straight) // 2
    indices = np.arange(apexes[0], apexes[1] + 1)
    return int(indices[np.argmax(speed[indices % len(speed)])])
