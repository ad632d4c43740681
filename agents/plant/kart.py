"""The plant as a control unit's hardware: moves the body, reads its sensors, meets borders."""

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from race_agents.plant.body import Body, as_built
from race_agents.plant.radar import Floats, Surroundings, scan, scan_all_around
from race_agents.plant.sensors import Beacons, Odometer, Receiver, Sensors, velocity_of
from race_agents.unit.control_unit import STOP
from race_agents.unit.readings import Readings
from race_agents.unit.safety import Command, Echoes
from race_server.core.messages import Control
from race_server.core.vehicles import Vehicle

Place = tuple[float, float, float]  # x [m], y [m], heading [rad]

# Longest time [s] between two checks for borders, and longest pause that the body moves through.
PART_S, MOST_S = 0.05, 2.0


@dataclass
class Plant:
    """A simulated kart, which its control unit cannot tell from a real one."""

    body: Body
    around: Surroundings
    sensors: Sensors
    seed: int
    look: Callable[[], Floats | None] = lambda: None  # the other karts, if there is news of them
    # Where the kart stands at first, once that is known; until then it is nowhere.
    find: Callable[[], Place | None] | None = None
    throttle: float | None = None  # the driver's foot, where a drill holds it down
    scrapes: int = 0
    command: Command = field(default_factory=Command)
    _now_s: float = -math.inf
    _radar_s: float = -math.inf
    _control: Control = STOP
    _is_scraping: bool = False
    _velocity: tuple[float, float] = (0.0, 0.0)  # [m/s] east and north, at the last reading

    def __post_init__(self) -> None:
        """Begin the sensors' noise."""
        self._noise = np.random.default_rng(self.seed)
        self._receiver = Receiver(self.sensors, self._noise)
        self._odometer = Odometer(self.sensors, self._noise)
        self._beacons = Beacons(self.sensors, self._noise)

    @classmethod
    def of(
        cls,
        vehicle: Vehicle,
        around: Surroundings,
        place: Place,
        sensors: Sensors,
        seed: int,
        look: Callable[[], Floats | None] = lambda: None,
    ) -> "Plant":
        """Return a kart of this kind on a place."""
        built = as_built(vehicle, random.Random(seed))
        return cls(Body(built, *place), around, sensors, seed, look)

    def read(self, now_s: float) -> Readings:
        """Advance the body to `now_s` and return the readings of the sensors."""
        if self.find is not None:
            self._begin(self.find())
        acceleration = None
        if self._now_s > -math.inf and self.find is None:
            self._move_on(min(now_s - self._now_s, MOST_S))
            acceleration = self._acceleration(now_s - self._now_s)
        self._now_s = now_s
        body, sensors, normal = self.body, self.sensors, self._noise.normal
        is_due = self._is_due(now_s)
        return Readings(
            time_s=now_s,
            wheel_speed=self._odometer.read(body, now_s),
            yaw_rate=body.yaw_rate + sensors.gyro_bias + normal(0.0, sensors.gyro_deviation),
            steering=body.steering,
            acceleration=acceleration,
            fix=self._receiver.read(body, now_s) if self.find is None else None,
            echoes=self._scan() if is_due else None,
            ranges=self._ranges() if is_due and sensors.lidar_rays else None,
            beacons=self._beacons.read(body, now_s),
            battery=body.charge,
        )

    def _begin(self, place: Place | None) -> None:
        """Stand on a place, once it is known."""
        if place is not None:
            self.body.x, self.body.y, self.body.heading = place
            self.find = None

    def _move_on(self, seconds: float) -> None:
        """Move the body; a process that was held up does not drive through walls meanwhile."""
        command = self.command
        while seconds > 0.0:
            part = min(seconds, PART_S)
            self.body.advance(part, command.steering, command.throttle, command.brake)
            self._meet_borders()
            seconds -= part

    def _acceleration(self, seconds: float) -> tuple[float, float] | None:
        """Return the mean acceleration since the last reading, ahead and to the left."""
        body, (was_east, was_north) = self.body, self._velocity
        midway = body.heading - 0.5 * body.yaw_rate * seconds
        cos, sin = math.cos(midway), math.sin(midway)
        east, north = velocity_of(body)
        self._velocity = east, north
        if seconds <= 0.0:
            return None
        x, y = (east - was_east) / seconds, (north - was_north) / seconds
        bias_ahead, bias_left = self.sensors.accelerometer_bias
        ahead, left = self._noise.normal(
            (x * cos + y * sin + bias_ahead, y * cos - x * sin + bias_left),
            self.sensors.accelerometer_deviation,
        )
        return float(ahead), float(left)

    def _scan(self) -> Echoes:
        others = self.look()
        if others is not None:
            self.around.others = others
        return scan(self.body, self.around, self._noise, self.sensors.radar)

    def _ranges(self) -> Floats:
        sensors = self.sensors
        half = 0.5 * sensors.lidar_field
        angles = np.linspace(-half, half, sensors.lidar_rays)
        ranges = scan_all_around(self.body, self.around, angles, sensors.lidar_reach)
        noisy = ranges + self._noise.normal(0.0, sensors.lidar_deviation, len(ranges))
        return np.where(ranges > 0.0, np.maximum(noisy, 0.0), 0.0)

    def _is_due(self, now_s: float) -> bool:
        if now_s - self._radar_s < self.sensors.radar_s - 1e-6:
            return False
        self._radar_s = now_s
        return True

    def act(self, command: Command) -> None:
        """Move the actuators."""
        self.command = command

    def hands(self, control: Control | None, now_s: float) -> Control | None:
        """Return the driver's input; in a drill the foot stays down whatever is seen."""
        del now_s
        if control is not None:
            self._control = control
        if self.throttle is None:
            return control
        return Control(self._control.steering, self.throttle, 0.0, self._control.buttons)

    def _meet_borders(self) -> None:
        """Keep the body inside the borders, as discs along its length."""
        body, vehicle = self.body, self.body.vehicle
        radius = 0.5 * vehicle.width
        near = self.around.borders_near(body.x, body.y, vehicle.length)
        touched = False
        for place in (-0.5, 0.0, 0.5):
            along = vehicle.box_offset + place * (vehicle.length - vehicle.width)
            x = body.x + along * math.cos(body.heading)
            y = body.y + along * math.sin(body.heading)
            touched |= self._push_off(near, x, y, radius)
        if touched and not self._is_scraping:
            self.scrapes += 1
        self._is_scraping = touched

    def _push_off(self, near: np.ndarray, x: float, y: float, radius: float) -> bool:
        """Move the body out of the nearest border and take away its speed into it."""
        if len(near) == 0:
            return False
        start, edge = near[:, :2], near[:, 2:] - near[:, :2]
        square = np.maximum((edge * edge).sum(axis=1), 1e-12)
        share = np.clip((((x, y) - start) * edge).sum(axis=1) / square, 0.0, 1.0)
        away = (x, y) - (start + share[:, None] * edge)
        distances = np.hypot(away[:, 0], away[:, 1])
        nearest = int(np.argmin(distances))
        distance = float(distances[nearest])
        if distance >= radius or distance == 0.0:
            return False
        body, (nx, ny) = self.body, away[nearest] / distance
        body.x += (radius - distance) * nx
        body.y += (radius - distance) * ny
        cos, sin = math.cos(body.heading), math.sin(body.heading)
        vx = body.speed * cos - body.lateral_speed * sin
        vy = body.speed * sin + body.lateral_speed * cos
        into = min(vx * nx + vy * ny, 0.0)
        vx, vy = 0.98 * (vx - into * nx), 0.98 * (vy - into * ny)
        body.speed, body.lateral_speed = vx * cos + vy * sin, vy * cos - vx * sin
        return True
