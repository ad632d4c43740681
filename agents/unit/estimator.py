"""All that tells a kart where it is, brought together in the order in which it happened."""

import math
from dataclasses import replace

import numpy as np

from race_agents.unit.borders import BorderEchoes, Borders, middle_of
from race_agents.unit.ekf import FARTHEST, KartFilter
from race_agents.unit.gyro_check import GyroCheck
from race_agents.unit.inertial import Inertial
from race_agents.unit.motion import BIAS, HEADING, SCALE, SPEED, Agility, Floats
from race_agents.unit.readings import Fix, Readings
from race_agents.unit.timeline import LATE_S, Late, Tick, Timeline
from race_agents.unit.tyres import Tyres
from race_agents.unit.wheels import Wheels
from race_server.core.vehicles import GRAVITY, Vehicle

# Deviation [rad/s] of the gyro.
GYRO_DEVIATION = 0.012
# Deviation [rad/s] of the turning rate that the steering angle tells, and as a share of it.
STEERED, STEERED_SHARE = 0.03, 0.25
# An acceleration, as a share of what the tyres hold, that only a wall or another kart can cause.
BLOW = 1.3
# Deviation [s] of the delay of a fix that carries no stamp about its mean.
JITTER_S = 0.01
# A gyro that was found to be off is shown as refused for this long [s].
SHOWN_S = 2.0
# Borders are looked at no more often than this [s].
LOOKS_S = 0.09
# What is faster than this [m/s] does not rest.
RESTS = 0.5
# Wheels that tell this much less [m/s] than the kart has at least do not turn, or do not tell it.
BELIED = 1.0
# A stamp is never of the future, nor older than this [s]: one clock was set, and it tells nothing.
MOST_AGE_S = 0.65


class Estimator:
    """Where a kart is, from its first fix on."""

    def __init__(
        self,
        vehicle: Vehicle,
        fix: Fix,
        heading: float,
        time_s: float,
        *,
        compliance: float | None = None,
        borders: Borders | None = None,
    ) -> None:
        """Begin at a fix.

        heading: [rad] in which the kart is taken to stand. compliance: of the rear tyres [s²/m],
        None: as the vehicle's cornering stiffness says. borders: that the radar sees.
        """
        if compliance is None:
            compliance = 1.0 / (GRAVITY * vehicle.cornering)
        self.filter = KartFilter(
            fix.x,
            fix.y,
            heading,
            lever=vehicle.rear_axle,
            agility=Agility.of(vehicle),
            compliance=compliance,
            heading_deviation=None if fix.heading is None else fix.heading_deviation,
            deviation=fix.deviation,
        )
        self.timeline = Timeline(self.filter, Tyres.of(vehicle), vehicle.rear_axle, borders)
        self.wheels, self.inertial = Wheels.of(vehicle), Inertial()
        self._gyro, self._gyro_off_s = GyroCheck(vehicle), -math.inf
        self._gyro_found: float | None = None  # [rad/s], until borders are seen
        self._gyro_found_s = 0.0
        self._looked_s = -math.inf  # at borders
        self._vehicle, self._borders = vehicle, borders
        self._time_s = time_s
        # Turning rates [rad/s] that were told last, by the gyro and by the steering, and when.
        self._rates: dict[bool, tuple[float, float]] = {True: (0.0, time_s)}

    def sense(self, readings: Readings, at_least: float = 0.0) -> list[tuple[Fix, bool]]:
        """Take the newest readings; return each fix once it is taken, and whether it was believed.

        The past is not driven again in a turn with a scan, since each costs much time. at_least:
        speed [m/s] that the kart has, by what needs no wheels.
        """
        tick, fix = self._tick(readings, at_least), readings.fix
        self._time_s = readings.time_s
        late = None if fix is None else self._late(fix, readings.time_s)
        return self.timeline.advance(tick, late, waits=readings.echoes is not None)

    def _late(self, fix: Fix, now_s: float) -> Late:
        """Return a fix with the moment it tells of."""
        stamp = fix.stamp_s
        if stamp is not None and 0.0 <= now_s - stamp <= MOST_AGE_S:
            return Late(stamp, fix, None)
        lag = self.filter.delay_s
        if fix.stamp_deviation_s == 0.0:
            fix = replace(fix, stamp_deviation_s=JITTER_S)
        return Late(now_s - lag, fix, lag)

    def _tick(self, readings: Readings, at_least: float) -> Tick:
        """Return a step as the sensors on board saw it."""
        now_s, felt = readings.time_s, readings.acceleration
        dt = max(now_s - self._time_s, 0.0)
        estimate = float(self.state[SPEED]) * (1.0 + float(self.state[SCALE]))
        pull = 0.0 if felt is None else felt[0] - self.inertial.bias[0]
        speed, wheel = readings.wheel_speed, None
        if not math.isnan(speed) and at_least - abs(speed) < BELIED:
            wheel = self.wheels.trusted(speed, estimate, pull, now_s)
        if at_least > RESTS:
            self.inertial.forget()
        elif math.isnan(speed + readings.yaw_rate):
            self.inertial.miss(now_s)
        else:
            self.inertial.watch(speed, readings.yaw_rate, felt, now_s)
        rate, deviation = self._turning(readings)
        seen = self._seen_borders(readings)
        return Tick(
            begins_s=now_s - dt,
            ends_s=now_s,
            yaw_rate=rate,
            gyro_deviation=deviation,
            wheel=wheel,
            felt=self._at_rear(felt, self._sway(readings, rate), dt),
            blow=self.blow(felt),
            gyro_off=self._gyro_off(readings, seen, dt),
            rests=self.inertial.rests and not self.wheels.is_lost and abs(estimate) < RESTS,
            beacons=readings.beacons,
            borders=seen,
        )

    def _seen_borders(self, readings: Readings) -> BorderEchoes | None:
        """Return what is used of a scan: not of each, for the filter's past is driven again."""
        is_due = not 0.0 <= readings.time_s - self._looked_s < LOOKS_S
        if self._borders is None or readings.echoes is None or not is_due:
            return None
        self._looked_s = readings.time_s
        return BorderEchoes.of(readings.echoes)

    def _gyro_off(self, readings: Readings, seen: BorderEchoes | None, dt: float) -> float | None:
        """Return what the gyro tells too much [rad/s], None if it is right or cannot be judged.

        Wheels and accelerometer say the same of a kart that spins on ice. Borders do not: they lie
        where they were only if the kart has not turned.
        """
        turn, speed = readings.yaw_rate - float(self.state[BIAS]), float(self.state[SPEED])
        found = self._gyro.bias(turn, readings.steering, readings.acceleration, speed, dt)
        if found is not None:
            self._gyro_found, self._gyro_found_s = found, readings.time_s
        found = self._gyro_found
        if found is None or seen is None or self._borders is None:
            return None
        self._gyro_found = None
        sighting = self._borders.sighting(seen, self.state)
        if sighting is None:
            return None
        # What has been put right of the heading already is not known, so half of it is tried.
        back = self.state.copy()
        back[HEADING] -= 0.5 * found * (readings.time_s - self._gyro_found_s + LATE_S)
        here, there = (middle_of(np.abs(sighting.residuals(at))) for at in (self.state, back))
        if there > here:
            return None
        self._gyro_off_s = readings.time_s
        return found

    def _turning(self, readings: Readings) -> tuple[float | None, float]:
        """Return the turning rate as the gyro tells it, and its deviation [rad/s].

        Without a gyro the wheels tell it by where they point, as far as the tyres do not slip.
        """
        if not math.isnan(readings.yaw_rate):
            return readings.yaw_rate, GYRO_DEVIATION
        if math.isnan(readings.steering):
            return None, GYRO_DEVIATION
        rate = float(self.state[SPEED]) * math.tan(readings.steering) / self._vehicle.wheelbase
        return rate + float(self.state[BIAS]), STEERED + STEERED_SHARE * abs(rate)

    def _sway(self, readings: Readings, rate: float | None) -> float:
        """Return how the middle of the kart sways aside as it turns faster [m/s²], 0 if untold.

        Two rates of one sensor tell it, over the time between them: a message may be missing.
        """
        if rate is None:
            return 0.0
        now_s, is_gyro = readings.time_s, not math.isnan(readings.yaw_rate)
        was, then_s = self._rates.get(is_gyro, (rate, now_s))
        self._rates[is_gyro] = rate, now_s
        return self._vehicle.rear_axle * (rate - was) / (now_s - then_s) if now_s > then_s else 0.0

    def _at_rear(
        self, felt: tuple[float, float] | None, sway: float, dt: float
    ) -> tuple[float, float] | None:
        """Return what the accelerometer would feel over the rear axle, but for turning [m/s²]."""
        if felt is None or dt <= 0.0:
            return None
        ahead, left = felt[0] - self.inertial.bias[0], felt[1] - self.inertial.bias[1]
        return float(ahead), float(left - sway)

    def blow(self, felt: tuple[float, float] | None) -> float:
        """Return the acceleration [m/s²] that no tyre can have caused, 0 for none."""
        if felt is None:
            return 0.0
        blow = math.hypot(*felt)
        return blow if blow > BLOW * self._vehicle.grip * GRAVITY else 0.0

    @property
    def is_gyro_off(self) -> bool:
        """Whether the gyro was found to be off not long ago."""
        return 0.0 <= self._time_s - self._gyro_off_s < SHOWN_S

    @property
    def is_ranged(self) -> bool:
        """Whether the last range to a beacon was believed."""
        return self.filter.squares.get("range", math.inf) <= FARTHEST**2

    @property
    def state(self) -> Floats:
        """State of the filter, see `race_agents.unit.motion`."""
        return self.filter.state

    @property
    def deviation(self) -> float:
        """Standard deviation [m] of the position, in its worse direction at most."""
        return self.filter.deviation

    @property
    def slowing(self) -> float:
        """By how much the kart slows down [m/s²], as it was felt last; 0 where nothing is felt."""
        return max(-self.filter.push[0], 0.0)

    @property
    def delay_s(self) -> float:
        """Delay of fixes without a stamp [s], as it was learned."""
        return self.filter.delay_s
