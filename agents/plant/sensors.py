"""How good a plant's sensors are, and those that err in their own way."""

import math
from collections import deque
from dataclasses import dataclass, field

import numpy as np

from race_agents.plant.body import Body
from race_agents.plant.radar import PERFECT, RadarErrors
from race_agents.unit.readings import Fix, Range
from race_server.core.messages import Source
from race_server.core.vehicles import GRAVITY

# Deviation of a receiver whose corrections are not resolved, FLOAT [m], for about this time [s].
FLOAT_DEVIATION, FADE_S = 0.3, 2.0
# A fix that was reflected is off by this [m], and the receiver does not know.
WILD = (2.0, 20.0)
# A range that was reflected is too long by this [m].
DETOUR = (0.5, 5.0)
# Slip of driven and braked wheels: acceleration as a share of gravity, over this [-].
SLIP_STIFFNESS = 15.0
# How fast a locked wheel stops, and one that is let go turns again [m/s²].
LOCKS, UNLOCKS = 80.0, 40.0


@dataclass(frozen=True)
class Sensors:
    """How good the sensors are: periods [s], standard deviations, shares of readings."""

    fix_s: float = 0.1
    fix_deviation: float = 0.02  # [m]; 0.3 to 1.5 for satellites without corrections
    fix_delay_s: float = 0.1  # from the antenna to the kart
    fix_jitter_s: float = 0.01  # of the delay
    fix_stamped: bool = True  # the receiver says when its antenna was there
    fix_loss: float = 0.0  # share of fixes that never come
    fix_wild: float = 0.0  # share of fixes that are reflected
    fix_fades: float = 0.0  # [1/s] how often corrections are lost for a while
    velocity_deviation: float | None = None  # [m/s] of speed and course; None: not told
    radar_s: float = 0.05
    radar: RadarErrors = PERFECT
    wheel_deviation: float = 0.03  # [m/s]
    wheel_scale: float = 0.0  # [-] by which the wheels' speed is too large
    wheels_lock: float = math.inf  # [0, 1] of the brakes, above which the wheels lock
    gyro_deviation: float = 0.01  # [rad/s]
    gyro_bias: float = 0.02  # [rad/s]
    accelerometer_deviation: float = 0.3  # [m/s²]
    accelerometer_bias: tuple[float, float] = (0.0, 0.0)  # [m/s²] ahead and to the left
    lidar_rays: int = 0  # of a lidar over the centre of gravity; 0: there is none
    lidar_field: float = 0.0  # [rad] between its outermost rays
    lidar_reach: float = 8.0  # [m]
    lidar_deviation: float = 0.02  # [m]
    heading_deviation: float | None = None  # [rad] of fixes by two antennas; None: there is one
    beacons: tuple[tuple[float, float], ...] = ()  # x, y [m] of radio beacons
    range_s: float = 0.02  # one beacon answers after the other
    range_deviation: float = 0.1  # [m]
    range_detours: float = 0.0  # share of ranges that are reflected


@dataclass
class Receiver:
    """A satellite receiver: its fixes are of the past."""

    sensors: Sensors
    chance: np.random.Generator
    _due_s: float = -math.inf
    _faded_until_s: float = -math.inf
    _on_way: deque[tuple[float, Fix]] = field(default_factory=deque)

    def read(self, body: Body, now_s: float) -> Fix | None:
        """Return the fix that arrives now, if one does; the antenna is over the body's place."""
        sensors = self.sensors
        if now_s - self._due_s >= sensors.fix_s - 1e-6:
            self._due_s = now_s
            if self.chance.random() >= sensors.fix_loss:
                delay = sensors.fix_delay_s
                if delay > 0.0:
                    delay += max(self.chance.normal(0.0, sensors.fix_jitter_s), -delay)
                self._on_way.append((now_s + delay, self._measure(body, now_s)))
        arrived = None
        while self._on_way and self._on_way[0][0] <= now_s + 1e-9:
            arrived = self._on_way.popleft()[1]
        return arrived

    def _measure(self, body: Body, now_s: float) -> Fix:
        sensors, chance = self.sensors, self.chance
        if chance.random() < sensors.fix_fades * sensors.fix_s:
            self._faded_until_s = now_s + chance.exponential(FADE_S)
        deviation = sensors.fix_deviation
        if now_s < self._faded_until_s:
            deviation = max(FLOAT_DEVIATION, deviation)
        x, y = chance.normal((body.x, body.y), deviation)
        if chance.random() < sensors.fix_wild:
            way, far = chance.uniform(0.0, 2.0 * math.pi), chance.uniform(*WILD)
            x, y = x + far * math.cos(way), y + far * math.sin(way)
        heading, spread = None, sensors.heading_deviation
        if spread is not None:
            heading = float(chance.normal(body.heading, spread))
        speed, course = None, 0.0
        if sensors.velocity_deviation is not None:
            east, north = chance.normal(velocity_of(body), sensors.velocity_deviation)
            speed, course = math.hypot(east, north), math.atan2(north, east)
        return Fix(
            float(x),
            float(y),
            deviation,
            Source.CORRECTED_SATELLITES if deviation < 0.5 else Source.SATELLITES,
            heading,
            heading_deviation=spread or 0.01,
            stamp_s=now_s if sensors.fix_stamped else None,
            stamp_deviation_s=0.0 if sensors.fix_stamped else sensors.fix_jitter_s,
            speed=speed,
            course=course,
            speed_deviation=sensors.velocity_deviation or 0.1,
        )


@dataclass
class Odometer:
    """The wheels' speed: they slip under load, and may lock."""

    sensors: Sensors
    chance: np.random.Generator
    _turns: float = 0.0  # [m/s] of the wheels' rims
    _was: float = 0.0  # [m/s] of the body
    _now_s: float = math.nan

    def read(self, body: Body, now_s: float) -> float:
        """Return the wheels' speed [m/s]."""
        dt, sensors = now_s - self._now_s, self.sensors
        rolls, self._now_s = body.speed, now_s
        if dt > 0.0:  # never at the first reading
            pull = math.copysign(1.0, body.speed) * (body.speed - self._was)
            rolls *= 1.0 + pull / (dt * GRAVITY * SLIP_STIFFNESS)
            target = 0.0 if body.brake > sensors.wheels_lock else rolls
            step = (LOCKS if abs(target) < abs(self._turns) else UNLOCKS) * dt
            locks = body.brake > sensors.wheels_lock or abs(rolls - self._turns) > step
            self._turns += max(-step, min(target - self._turns, step)) if locks else 0.0
            self._turns = self._turns if locks else rolls
        else:
            self._turns = rolls
        self._was = body.speed
        noise = self.chance.normal(0.0, sensors.wheel_deviation)
        return float((1.0 + sensors.wheel_scale) * self._turns + noise)


@dataclass
class Beacons:
    """Radio beacons that answer one after the other; some answers come by a detour."""

    sensors: Sensors
    chance: np.random.Generator
    _due_s: float = -math.inf
    _next: int = 0

    def read(self, body: Body, now_s: float) -> tuple[Range, ...]:
        """Return the ranges that arrive now."""
        sensors = self.sensors
        if not sensors.beacons or now_s - self._due_s < sensors.range_s - 1e-6:
            return ()
        self._due_s = now_s
        x, y = sensors.beacons[self._next % len(sensors.beacons)]
        self._next += 1
        far = math.hypot(body.x - x, body.y - y)
        far += self.chance.normal(0.0, sensors.range_deviation)
        if self.chance.random() < sensors.range_detours:
            far += self.chance.uniform(*DETOUR)
        return (Range(x, y, float(far), sensors.range_deviation),)


def velocity_of(body: Body) -> tuple[float, float]:
    """Return the velocity of a body's centre of gravity [m/s], east and north."""
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    return (
        body.speed * cos - body.lateral_speed * sin,
        body.speed * sin + body.lateral_speed * cos,
    )
