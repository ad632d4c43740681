"""How a corner was driven, against another lap: by how much, and which way, in numbers."""

from dataclasses import dataclass

import numpy as np

from race_server.coaching.corners import Corner
from race_server.coaching.lap import Lap
from race_server.scenario.track.course import Floats

# Where the speed has dropped by these shares on the way to the apex the brakes are compared, and
# where it has risen by as much behind it the throttle.
BRAKING = (0.35, 0.45, 0.55, 0.65, 0.75)
RISING = (0.15, 0.2, 0.25, 0.3, 0.35)
# Real braking is where this share of the drop in speed is lost.
EASED = 0.25
# A stretch without acceleration is one with less than this share of the other lap's there.
SLACK = 0.35
# A throttle that is lifted is closed by this share.
LIFTED = 0.3
# Points over which acceleration and throttle are averaged.
CALM = 5


@dataclass(frozen=True)
class Features:
    """Differences of a lap from another one in a corner; zero where both are driven alike."""

    pace: float  # [m/s] mean speed of the other lap from here to the next corner
    drop: float  # share of its speed that the other lap loses here
    early: float  # [m] by which it slows down sooner
    eased: float  # [m] more from its highest speed to real braking
    rolled: float  # share by which its throttle is closed on these metres
    slow: float  # [m/s] that it is slower around the apex
    late: float  # [m] by which it gains speed later
    lifted: float  # [m] without acceleration on the way out, where the other lap accelerates
    lifted_from: float  # where that begins: share of the way from the slowest place to the exit
    shut: float  # share by which its throttle is less open on the way to the exit
    entry_wide: float  # [m] further outside at the turn-in, at most
    apex_wide: float  # [m] further outside around the apex
    exit_tight: float  # [m] further inside on the way out, at most


def features_of(lap: Lap, other: Lap, corner: Corner) -> Features:
    """Return how a lap takes a corner, against another one."""
    own, wanted = _Pass(lap, corner), _Pass(other, corner)
    outside = -corner.side * (own.offset - wanted.offset)
    turning = corner.apex - corner.entry
    leaving = corner.exit - corner.apex
    hold, rising = 0.2 * min(turning, leaving), 0.25 * leaving
    more, (lifted, lifted_from) = own.easing() - wanted.easing(), own.slack(wanted)
    top = float(wanted.speed[wanted.high])
    return Features(
        pace=float(wanted.speed.mean()),
        drop=1.0 - wanted.slowest / top,
        early=wanted.braked(BRAKING, own) - own.braked(BRAKING, wanted),
        eased=more,
        rolled=1.0 - own.pressed(more),
        slow=own.mean(wanted.speed - own.speed, corner.apex - hold, corner.apex + hold),
        late=own.gained(RISING, wanted) - wanted.gained(RISING, own),
        lifted=lifted,
        lifted_from=lifted_from,
        shut=own.mean(wanted.throttle - own.throttle, float(wanted.at[wanted.low]), corner.exit),
        entry_wide=own.most(outside, corner.entry - 0.25 * turning, corner.entry + 0.5 * turning),
        apex_wide=own.mean(outside, corner.apex - rising, corner.apex + rising),
        exit_tight=own.most(-outside, corner.exit - 2.0 * rising, corner.exit + rising),
    )


class _Pass:
    """One lap's way through a corner, from where it begins to where the next one does."""

    def __init__(self, lap: Lap, corner: Corner) -> None:
        count = len(lap.progress) - 1
        first, last = round(corner.begin / lap.step), round(corner.end / lap.step)
        self.step = lap.step
        self.at = np.arange(first, last + 1) * lap.step
        index = np.arange(first, last + 1) % count
        self.speed = lap.speed[index]
        self.offset = lap.offset[index]
        self.throttle = _calm(lap.throttle[index])
        way = lap.ways[index[:-1]]
        pull = np.diff(self.speed**2) / (2.0 * np.maximum(way, 1e-6))
        # Averaged, but not where the lap jumps from its end to its beginning.
        if (cut := int(np.argmax(index[:-1] == count - 1))) and 0 < cut < len(pull) - 1:
            pull[cut] = 0.5 * (pull[cut - 1] + pull[cut + 1])
        self.pull = _calm(np.append(pull, pull[-1]))
        # The slowest place between the first half of the way in and the last of the way out.
        inside = (self.at >= corner.entry) & (self.at <= corner.exit)
        self.low = int(np.flatnonzero(inside)[np.argmin(self.speed[inside])])
        self.slowest = float(self.speed[self.low])
        self.high = int(np.argmax(self.speed[: self.low + 1]))
        self.corner = corner

    def braked(self, shares: tuple[float, ...], other: "_Pass") -> float:
        """Return where [m] speeds are reached on the way down that both passes have."""
        return float(np.median([self._down(level) for level in _levels(self, other, shares, -1)]))

    def gained(self, shares: tuple[float, ...], other: "_Pass") -> float:
        """Return where [m] speeds are reached on the way up that both passes have."""
        return float(np.median([self._up(level) for level in _levels(self, other, shares, 1)]))

    def _down(self, level: float) -> float:
        """Return where [m] the speed last is above a level before the slowest place."""
        above = np.flatnonzero(self.speed[: self.low + 1] >= level)
        if not len(above):
            return float(self.at[0])
        return self._crossing(int(above[-1]), level)

    def _up(self, level: float) -> float:
        """Return where [m] the speed is below a level for the last time before it stays above."""
        below = np.flatnonzero(self.speed[self.low :] < level)
        return self._crossing(self.low + (int(below[-1]) if len(below) else 0), level)

    def _crossing(self, index: int, level: float) -> float:
        if index + 1 >= len(self.speed) or self.speed[index] == self.speed[index + 1]:
            return float(self.at[index])
        share = (level - self.speed[index]) / (self.speed[index + 1] - self.speed[index])
        return float(self.at[index] + np.clip(share, 0.0, 1.0) * self.step)

    def easing(self) -> float:
        """Return how far [m] it is from the highest speed to where a part of it is lost."""
        top = float(self.speed[self.high])
        return self._down(top - EASED * (top - self.slowest)) - float(self.at[self.high])

    def pressed(self, easing: float) -> float:
        """Return the mean of the throttle over a way [m] from the highest speed on."""
        start = float(self.at[self.high])
        return self.mean(self.throttle, start, start + max(easing, self.step))

    def slack(self, other: "_Pass") -> tuple[float, float]:
        """Return the longest stretch on the way out where only the other pass accelerates.

        That is its length [m], and where it begins, as a share of the way from the other pass's
        slowest place to the exit.
        """
        start = max(self.low, other.low)
        least = SLACK * other.pull[start:]
        slack = (self.pull[start:] < least) & (other.pull[start:] > 0.3 * other.pull.max())
        # A weak motor is no lift.
        slack &= self.throttle[start:] <= (1.0 - LIFTED) * other.throttle[start:]
        longest, end, run = 0, 0, 0
        for index, now in enumerate(slack.tolist()):
            run = run + 1 if now else 0
            if run > longest:
                longest, end = run, index
        if not longest:
            return 0.0, 0.0
        low = float(other.at[other.low])
        begun = float(self.at[start + end + 1 - longest]) - low
        return longest * self.step, begun / max(self.corner.exit - low, self.step)

    def mean(self, values: Floats, start: float, end: float) -> float:
        """Return the mean of values between two places [m]."""
        inside = (self.at >= start) & (self.at <= end)
        return float(values[inside].mean()) if inside.any() else 0.0

    def most(self, values: Floats, start: float, end: float) -> float:
        """Return the most of values between two places [m]."""
        inside = (self.at >= start) & (self.at <= end)
        return float(values[inside].max()) if inside.any() else 0.0


def _calm(values: Floats) -> Floats:
    """Return values (n,) averaged over CALM points each."""
    padded = np.pad(values, CALM // 2, mode="edge")
    return np.convolve(padded, np.full(CALM, 1.0 / CALM), mode="valid")


def _levels(one: _Pass, other: _Pass, shares: tuple[float, ...], side: int) -> tuple[float, ...]:
    """Return speeds that two passes both have before (-1) or behind (1) their slowest places."""
    low = max(one.slowest, other.slowest)
    if side < 0:
        high = min(float(one.speed[: one.low + 1].max()), float(other.speed[: other.low + 1].max()))
        return tuple(high - share * (high - low) for share in shares)
    high = min(float(one.speed[one.low :].max()), float(other.speed[other.low :].max()))
    return tuple(low + share * (high - low) for share in shares)
