"""The last 0.7 s of a filter: a fix that comes late is taken where it belongs.

A receiver needs about 100 ms to say where its antenna was, in which a kart at 60 km/h moves 1.7 m.
The filter is set back to the moment of the fix, takes it, and drives forward again with the
readings that were kept.
"""

from bisect import insort
from collections import deque
from dataclasses import dataclass, field

from race_agents.unit.borders import BorderEchoes, Borders
from race_agents.unit.ekf import KartFilter, Snapshot
from race_agents.unit.motion import SLIDE, SPEED, YAW_RATE
from race_agents.unit.readings import Fix, Range
from race_agents.unit.tyres import Tyres

HORIZON_S = 0.7
# A gyro that is off is found out after about this time [s].
LATE_S = 0.5


@dataclass(frozen=True)
class Tick:
    """What the sensors on board gave for one step of time."""

    begins_s: float
    ends_s: float
    yaw_rate: float | None  # [rad/s] of the gyro, None where nothing tells it
    gyro_deviation: float  # [rad/s]
    wheel: tuple[float, float] | None  # speed and deviation [m/s], None where it is not trusted
    felt: tuple[float, float] | None  # [m/s²] at the rear axle, but for turning
    blow: float = 0.0  # [m/s²] that no tyre can have caused
    gyro_off: float | None = None  # [rad/s] that the gyro tells too much, as others show
    rests: bool = False
    beacons: tuple[Range, ...] = ()
    borders: BorderEchoes | None = None

    def push(self, filtered: KartFilter, lever: float) -> tuple[float, float] | None:
        """Return how the speeds of the rear axle change [m/s²], ahead and to the left."""
        if self.felt is None:
            return None
        state = filtered.state
        turn, speed, slide = state[YAW_RATE], state[SPEED], state[SLIDE]
        ahead = self.felt[0] + turn * (slide + lever * turn)
        return float(ahead), float(self.felt[1] - turn * speed)


@dataclass(frozen=True, order=True)
class Late:
    """A fix and the moment that it tells of."""

    time_s: float
    fix: Fix = field(compare=False)
    lag: float | None = field(compare=False)  # [s] that was taken for its delay, None: stamped


@dataclass
class Past:
    """A step, the filter before it, and the fixes of that time."""

    before: Snapshot
    tick: Tick
    fixes: list[Late] = field(default_factory=list)


class Timeline:
    """A filter with a past."""

    def __init__(
        self, filtered: KartFilter, tyres: Tyres, lever: float, borders: Borders | None = None
    ) -> None:
        """Begin now. lever: [m] from the rear axle forward to the accelerometer and the antenna."""
        self.filter, self._tyres = filtered, tyres
        self._lever, self._borders = lever, borders
        self._past: deque[Past] = deque()

    def advance(self, tick: Tick, late: Late | None = None) -> bool:
        """Drive on and take what the sensors on board gave, and a fix that came meanwhile.

        Return whether the fix was believed. One of the past comes first: what is driven again is
        then a step less.
        """
        if self._past and tick.ends_s < self._past[-1].tick.ends_s:
            self._past.clear()  # the clock was set back: what was noted is of another time
        is_past = late is not None and late.time_s < tick.begins_s
        believed = late is not None and is_past and self.insert(late)
        past = Past(self.filter.snapshot(), tick)
        self._past.append(past)
        self._live(past)
        while self._past[0].tick.ends_s < tick.ends_s - HORIZON_S:
            self._past.popleft()
        return believed if late is None or is_past else self.insert(late)

    def insert(self, late: Late) -> bool:
        """Take a fix where it belongs; False if it was not believed."""
        if not self._past or late.time_s >= self._past[-1].tick.ends_s:
            return self._see(late)
        if late.time_s < self._past[0].tick.begins_s:
            return False
        place = len(self._past) - 1
        while late.time_s < self._past[place].tick.begins_s:
            place -= 1
        insort(self._past[place].fixes, late)
        self.filter.restore(self._past[place].before)
        believed = False
        for number in range(place, len(self._past)):
            past = self._past[number]
            past.before = self.filter.snapshot()
            believed |= self._live(past, late)
        return believed

    def _live(self, past: Past, asked: Late | None = None) -> bool:
        """Go through one step; return whether the fix that is asked for was believed."""
        tick, now, believed = past.tick, past.tick.begins_s, False
        for late in past.fixes:
            self._predict(tick, late.time_s - now)
            now = late.time_s
            is_believed = self._see(late)
            believed |= is_believed and late is asked
        self._predict(tick, tick.ends_s - now)
        self._take(tick)
        return believed

    def _predict(self, tick: Tick, dt: float) -> None:
        self.filter.predict(dt, push=tick.push(self.filter, self._lever), blow=tick.blow)

    def _take(self, tick: Tick) -> None:
        filtered = self.filter
        if tick.gyro_off is not None:
            filtered.mend_bias(tick.gyro_off, tick.gyro_off * LATE_S)
        if tick.blow == 0.0:
            self._tyres.see(filtered, None if tick.felt is None else tick.felt[1])
        if tick.wheel is not None:
            filtered.see_speed(*tick.wheel)
        if tick.yaw_rate is not None:
            filtered.see_yaw_rate(tick.yaw_rate, tick.gyro_deviation)
        if tick.rests:
            filtered.see_rest()
        for beacon in tick.beacons:
            filtered.see_range(beacon.x, beacon.y, beacon.distance, beacon.deviation)
        if tick.borders is not None and self._borders is not None:
            # Which border an echo is of follows from where the kart is taken to be by now.
            seen = self._borders.sighting(tick.borders, filtered.state)
            if seen is not None:
                filtered.see_borders(seen)

    def _see(self, late: Late) -> bool:
        """Take a fix of this very moment."""
        fix, filtered = late.fix, self.filter
        believed = filtered.see_position(
            fix.x, fix.y, fix.deviation, lag=late.lag, jitter=fix.stamp_deviation_s
        )
        if fix.speed is not None:
            filtered.see_velocity(fix.speed, fix.course, fix.speed_deviation)
        if fix.heading is not None:
            filtered.see_heading(fix.heading, fix.heading_deviation)
        return believed
