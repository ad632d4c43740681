"""What each sensor of a kart is worth: it may fall silent, repeat itself, or say what cannot be.

Readings pass through here before anything else sees them. What is no number in range is taken out,
and so is a place that stands still while the kart drives; the others have to do without.
"""

import math
from collections.abc import Hashable
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.limits import Limits
from race_agents.unit.readings import MOST_RAYS, Fix, Range, Readings
from race_agents.unit.safety import Echoes
from race_agents.unit.seen_motion import MOST_SPEED, SeenMotion
from race_server.core import codes
from race_server.core.messages import RayHit
from race_server.core.telemetry import Sensor, SensorState
from race_server.core.vehicles import GRAVITY, Vehicle

# Nothing new for this long [s]: the sensor is silent. Those of the bus speak at each turn.
SILENT_S = {
    Sensor.FIXES: 0.45,
    Sensor.BEACONS: 0.45,
    Sensor.WHEELS: 0.06,
    Sensor.GYRO: 0.06,
    Sensor.ACCELEROMETER: 0.06,
    Sensor.STEERING: 0.06,
    Sensor.RADAR: 0.25,
    Sensor.LIDAR: 0.25,
}
# The same number to its last digit for this long [s], while the kart moves: it hangs.
STUCK_S = 0.25
# From this speed [m/s] on no sensor's noise is small enough to repeat itself.
MOVES = 2.0
# A steering angle may stand still, but not once one that differs by more than this [rad] has been
# asked for during this time [s].
ASKED, ASKED_S = 0.05, 0.5
# Beyond any kart: turning rate [rad/s], acceleration [g], steering angle [rad], place [m].
MOST_TURN, MOST_FELT, MOST_ANGLE, MOST_PLACE = 20.0, 100.0, 1.5, 1e6
# Beyond any heading [rad], any time of a receiver's clock [s].
MOST_HEADING, MOST_STAMP = 1e3, 1e12
# A kart without one of these cannot see people, and stands.
EYES = (Sensor.RADAR,)
# … and without one of these it does not know how it moves, and crawls.
FEET = (Sensor.WHEELS, Sensor.GYRO, Sensor.STEERING)
MOST_KIND = max(RayHit)  # other numbers are things that nothing is known of
FAILED = (SensorState.SILENT, SensorState.STUCK)


@dataclass
class Line:
    """What came from one sensor."""

    heard_s: float = -math.inf  # when something came that could be used
    value: Hashable = None
    since_s: float = -math.inf  # since when it is this value
    is_stuck: bool = False

    def note(self, value: Hashable, now_s: float, stuck_s: float | None) -> None:
        """Take what came. stuck_s: [s] of the same value that are too long; None: it may be."""
        if value != self.value or now_s < self.since_s:
            self.value, self.since_s, self.is_stuck = value, now_s, False
        self.heard_s = now_s
        self.is_stuck |= stuck_s is not None and now_s - self.since_s >= stuck_s


@dataclass
class SensorWatch:
    """The state of all sensors of a kart."""

    vehicle: Vehicle
    seen: SeenMotion = field(init=False)
    _lines: dict[Sensor, Line] = field(default_factory=lambda: {each: Line() for each in Sensor})
    _began_s: float | None = None
    _now_s: float = 0.0
    _believed_s: dict[Sensor, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Have seen no motion."""
        self.seen = SeenMotion(Limits.of(self.vehicle).nose)

    def take(self, readings: Readings, speed: float, asked: float) -> Readings:
        """Return what of some readings can be used.

        speed: [m/s] of the kart as it is known; asked: [rad] of steering that was commanded last.
        """
        now_s = self._now_s = readings.time_s
        if self._began_s is None or now_s < self._began_s:
            self._began_s = now_s
        for line in self._lines.values():
            line.heard_s = min(line.heard_s, now_s)  # the clock was set back
        self._believed_s = {each: min(at, now_s) for each, at in self._believed_s.items()}
        moves = STUCK_S if self._moves(readings, speed) else None
        lags = ASKED_S if abs(readings.steering - asked) > ASKED else None
        if lags is None:  # it stood still rightly until now
            self._lines[Sensor.STEERING].since_s = now_s
        felt = readings.acceleration
        if felt is not None and not _are_within(felt, MOST_FELT * GRAVITY):
            felt = None
        if felt is not None:
            self._lines[Sensor.ACCELEROMETER].note(felt, now_s, moves)
        beacons = tuple(filter(_is_sound, readings.beacons))
        if beacons:
            self._lines[Sensor.BEACONS].note(beacons, now_s, None)
        ranges = readings.ranges
        if ranges is not None:
            is_sound = len(ranges) <= MOST_RAYS and bool(np.isfinite(ranges).all())
            ranges = ranges if is_sound else None
        if ranges is not None:
            self._lines[Sensor.LIDAR].note(ranges.tobytes(), now_s, moves)
        return replace(
            readings,
            wheel_speed=self._number(
                Sensor.WHEELS, readings.wheel_speed, 2.0 * self.vehicle.top_speed, moves
            ),
            yaw_rate=self._number(Sensor.GYRO, readings.yaw_rate, MOST_TURN, moves),
            steering=self._number(Sensor.STEERING, readings.steering, MOST_ANGLE, lags),
            acceleration=None if self._lines[Sensor.ACCELEROMETER].is_stuck else felt,
            fix=self._fix(readings.fix, moves),
            echoes=self._echoes(readings.echoes, moves),
            beacons=beacons,
            ranges=ranges,
            battery=_charge_of(readings.battery),
        )

    def _moves(self, readings: Readings, speed: float) -> bool:
        """Return whether the kart drives, by its estimate or by what needs no wheels."""
        if abs(speed) > MOVES:
            return True
        self.seen.take(readings)
        return self.seen.speed(self._now_s) > MOVES

    def _number(self, sensor: Sensor, value: float, most: float, stuck_s: float | None) -> float:
        """Return a number of the bus, NaN where it cannot be used."""
        if not _are_within((value,), most):
            return math.nan
        line = self._lines[sensor]
        line.note(value, self._now_s, stuck_s)
        return math.nan if line.is_stuck else value

    def _fix(self, fix: Fix | None, moves: float | None) -> Fix | None:
        """Return a fix that may be true: a kart that moves is never in the same place again."""
        fix = None if fix is None else _sound_of(fix)
        if fix is None:
            return None
        line, place = self._lines[Sensor.FIXES], (fix.x, fix.y)
        again = line.value == place and moves is not None
        line.note(place, self._now_s, moves)
        return None if again else fix

    def _echoes(self, echoes: Echoes | None, moves: float | None) -> Echoes | None:
        """Return the echoes of a scan that are numbers."""
        if echoes is None:
            return None
        table = np.stack([echoes.x, echoes.y, echoes.closing])
        sound: NDArray[np.bool_] = np.asarray(np.isfinite(table).all(axis=0))
        if len(sound) and not sound.any():
            return None
        may_hang = moves if len(sound) else None  # an empty place looks the same again
        self._lines[Sensor.RADAR].note(table.tobytes(), self._now_s, may_hang)
        strange = echoes.kinds > MOST_KIND
        if strange.any():
            kinds = np.where(strange, codes.OBSTACLE, echoes.kinds).astype(np.uint8)
            echoes = replace(echoes, kinds=kinds)
        return echoes if sound.all() else echoes.kept(sound)

    def judge(self, sensor: Sensor, *, is_believed: bool) -> None:
        """Note whether what a sensor said agreed with the others."""
        if is_believed or sensor not in self._believed_s:
            self._believed_s[sensor] = self._now_s

    def state(self, sensor: Sensor) -> SensorState:
        """Return what a sensor is worth now."""
        line, silent_s = self._lines[sensor], SILENT_S[sensor]
        if line.heard_s == -math.inf:
            return SensorState.ABSENT
        if self._now_s - line.heard_s > silent_s:
            return SensorState.SILENT
        if line.is_stuck:
            return SensorState.STUCK
        believed_s = self._believed_s.get(sensor, self._now_s)
        return SensorState.REFUSED if self._now_s - believed_s > silent_s else SensorState.WELL

    def states(self) -> tuple[SensorState, ...]:
        """Return what all sensors are worth now, in the order of their numbers."""
        return tuple(map(self.state, Sensor))

    @property
    def is_blind(self) -> bool:
        """Whether the kart cannot see what is ahead."""
        return any(self._is_gone(sensor) for sensor in EYES)

    @property
    def is_lame(self) -> bool:
        """Whether the kart does not know how it moves. Not every kart has an accelerometer."""
        if self.state(Sensor.ACCELEROMETER) in FAILED:
            return True
        return any(self._is_gone(sensor) for sensor in FEET)

    def _is_gone(self, sensor: Sensor) -> bool:
        """Return whether a sensor that has to be there is not, some time after the start."""
        state = self.state(sensor)
        if state is not SensorState.ABSENT:
            return state in FAILED
        return self._began_s is not None and self._now_s - self._began_s > SILENT_S[sensor]


def _sound_of(fix: Fix) -> Fix | None:
    """Return what is sound of a fix: a place, and what comes with it as far as it can be used."""
    if not (_are_within((fix.x, fix.y, fix.deviation), MOST_PLACE) and fix.deviation > 0.0):
        return None
    turned, spread = fix.heading, fix.heading_deviation
    if turned is not None and not (_are_within((turned, spread), MOST_HEADING) and spread > 0.0):
        fix = replace(fix, heading=None)
    if fix.speed is not None:
        is_sound = _are_within((fix.speed, fix.speed_deviation), MOST_SPEED)
        is_sound &= fix.speed_deviation > 0.0 and _are_within((fix.course,), MOST_HEADING)
        fix = fix if is_sound else replace(fix, speed=None)
    stamps = fix.stamp_s or 0.0, fix.stamp_deviation_s
    return (
        fix
        if _are_within(stamps, MOST_STAMP)
        else replace(fix, stamp_s=None, stamp_deviation_s=0.0)
    )


def _charge_of(battery: float | None) -> float | None:
    """Return a charge within [0, 1], None for what is no number; gauges overshoot a little."""
    return None if battery is None or math.isnan(battery) else min(max(battery, 0.0), 1.0)


def _is_sound(beacon: Range) -> bool:
    numbers = beacon.x, beacon.y, beacon.distance, beacon.deviation
    return _are_within(numbers, MOST_PLACE) and beacon.deviation > 0.0


def _are_within(values: tuple[float, ...], most: float) -> bool:
    """Return whether all are numbers of at most this size; comparisons with NaN are false."""
    return all(-most <= value <= most for value in values)
