"""The last 0.8 s of a filter: a fix that comes late is taken where it belongs.

A receiver needs about 100 ms to say where its antenna was, in which a kart at 60 km/h moves 1.7 m.
The filter is set back to the moment of the fix, takes it, and drives forward again with the
readings that were kept: some steps in each turn, so that no turn takes much longer than the others.
Until it is there, a few turns later, the filter of before goes on, and fixes that come wait.
"""

from bisect import insort
from collections import deque
from dataclasses import dataclass

from race_agents.unit.borders import BorderEchoes, Borders
from race_agents.unit.ekf import KartFilter, Snapshot
from race_agents.unit.motion import SLIDE, SPEED, YAW_RATE
from race_agents.unit.readings import Fix, Range
from race_agents.unit.tyres import Tyres

HORIZON_S = 0.8
# The past is driven again in this number of turns at most, in each this number of steps at least.
# One with borders takes as long as some, and is as a rule all that the turn after a scan drives.
TURNS, STEPS, LIKE_STEPS = 2, 6, 4
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


@dataclass(frozen=True, eq=False)
class Late:
    """A fix and the moment that it tells of."""

    time_s: float
    fix: Fix
    lag: float | None  # [s] that was taken for its delay, None: stamped


@dataclass
class Past:
    """A step, the filter before it, and the fixes of that time."""

    before: Snapshot
    tick: Tick
    fixes: list[Late]


class Timeline:
    """A filter with a past."""

    def __init__(
        self, filtered: KartFilter, tyres: Tyres, lever: float, borders: Borders | None = None
    ) -> None:
        """Begin now. lever: [m] from the rear axle forward to the accelerometer and the antenna."""
        self.filter, self._tyres = filtered, tyres
        self._lever, self._borders = lever, borders
        self._past: deque[Past] = deque()
        self.work = 0  # that was driven again in the last turn, in steps without borders
        self._behind = 0  # steps at the end of the past that have to be driven again
        self._turns = 0  # in which that has to be done
        self._has_waited = False  # in the last turn
        self._waiting: list[Late] = []  # fixes that come meanwhile
        self._asked: list[Late] = []  # fixes that are in the past and were not seen yet
        self._answers: list[tuple[Fix, bool]] = []

    def advance(
        self, tick: Tick, late: Late | None = None, *, waits: bool = False
    ) -> list[tuple[Fix, bool]]:
        """Drive on and take what the sensors on board gave, and a fix that came meanwhile.

        Return fixes and whether they were believed, each once that is known. waits: the past is
        driven again in other turns, but for every other one, and borders are seen then.
        """
        if self._past and tick.ends_s < self._past[-1].tick.ends_s:
            self._forget()  # the clock was set back: what was noted is of another time
        self._answers, self._has_waited = [], waits and not self._has_waited
        if late is not None:
            self._waiting.append(late)
        fixes = [] if self._behind else self._insert(tick)
        self.work = 0
        if self._behind and not self._has_waited:
            self._drive_again()
        past = Past(self.filter.snapshot(), tick, fixes)
        self._past.append(past)
        self._live(past, waits=self._has_waited)
        if self._behind or (self._has_waited and tick.borders is not None):
            self._behind, self._turns = self._behind + 1, self._turns or TURNS
        while len(self._past) > self._behind + 1 and self._is_old(self._past[0], tick.ends_s):
            self._past.popleft()
        return self._answers

    def _forget(self) -> None:
        self._past.clear()
        self._behind = self._turns = 0
        self._waiting, self._asked = [], []

    def _is_old(self, past: Past, now_s: float) -> bool:
        return past.tick.ends_s < now_s - HORIZON_S

    def _insert(self, tick: Tick) -> list[Late]:
        """Note fixes that wait where they belong; return those of a step that begins.

        One from before all that is known is not believed.
        """
        now: list[Late] = []
        waiting, self._waiting = self._waiting, []
        self._asked += waiting
        for late in waiting:
            if late.time_s > tick.begins_s or not self._past:
                insort(now, late, key=_time_of)
            elif late.time_s < self._past[0].tick.begins_s:
                self._tell(late, is_believed=False)
            else:
                behind, most = 1, len(self._past)
                while behind < most and late.time_s <= self._past[-behind].tick.begins_s:
                    behind += 1
                insort(self._past[-behind].fixes, late, key=_time_of)
                self._behind, self._turns = max(self._behind, behind), TURNS
        return now

    def _drive_again(self) -> None:
        """Drive some steps of the past again; once all are, that is where the kart is."""
        filtered, now = self.filter, self.filter.snapshot()
        whole = sum(_cost_of(self._past[-place]) for place in range(1, self._behind + 1))
        most = max(STEPS, whole / self._turns)
        filtered.restore(self._past[-self._behind].before)
        while self._behind and self.work < most:
            past = self._past[-self._behind]
            past.before = filtered.snapshot()
            self._live(past)
            self._behind -= 1
            self.work += _cost_of(past)
        self._turns -= 1
        if self._behind:
            self._past[-self._behind].before = filtered.snapshot()
            filtered.restore(now)
        else:
            self._turns = 0

    def _live(self, past: Past, *, waits: bool = False) -> None:
        """Go through one step: a fix of its end comes after what the sensors on board gave.

        waits: borders are left out, which will be seen when the step is driven again.
        """
        tick, now = past.tick, past.tick.begins_s
        at_end = []
        for late in past.fixes:
            if late.time_s >= tick.ends_s:
                at_end.append(late)
                continue
            self._predict(tick, late.time_s - now)
            now = late.time_s
            self._tell(late, is_believed=self._see(late))
        self._predict(tick, tick.ends_s - now)
        self._take(tick)
        if not waits:
            self._see_borders(tick)
        for late in at_end:
            self._tell(late, is_believed=self._see(late))

    def _tell(self, late: Late, *, is_believed: bool) -> None:
        """Say whether a fix is believed, when it is taken for the first time."""
        if late in self._asked:
            self._asked.remove(late)
            self._answers.append((late.fix, is_believed))

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

    def _see_borders(self, tick: Tick) -> None:
        if tick.borders is not None and self._borders is not None:
            # Which border an echo is of follows from where the kart is taken to be by now.
            seen = self._borders.sighting(tick.borders, self.filter.state)
            if seen is not None:
                self.filter.see_borders(seen)

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


def _time_of(late: Late) -> float:
    return late.time_s


def _cost_of(past: Past) -> int:
    """Return how long a step takes, as a number of steps."""
    return 1 if past.tick.borders is None else LIKE_STEPS
