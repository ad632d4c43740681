"""What stands around a kart that exists, and what its radar sees of it."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from agents.reflex import Echoes
from plant.body import Body
from race_server import codes
from race_server.params import Vehicle

Floats = NDArray[np.float64]

# A beam every 3° from -60° to 60°. Nine thin rays would see past a person 3 m away.
BEAMS = np.radians(np.linspace(-60.0, 60.0, 41))
REACH_LENGTHS = 20.0  # kart lengths


@dataclass
class Person:
    """Somebody, or something, that stands on the track."""

    x: float
    y: float
    radius: float


@dataclass
class Surroundings:
    """Borders, other karts, people."""

    borders: Floats  # (P, 4)
    others: Floats = field(default_factory=lambda: np.zeros((0, 5)))  # x, y, heading, vx, vy
    people: list[Person] = field(default_factory=list)

    def borders_near(self, x: float, y: float, reach: float) -> Floats:
        """Return the borders that come within `reach` [m] of a point."""
        middle = 0.5 * (self.borders[:, :2] + self.borders[:, 2:])
        half = 0.5 * np.hypot(*(self.borders[:, 2:] - self.borders[:, :2]).T)
        near = np.hypot(middle[:, 0] - x, middle[:, 1] - y) - half < reach
        result: Floats = self.borders[near]
        return result


def scan(body: Body, around: Surroundings, chance: np.random.Generator) -> Echoes:
    """Return what the radar in the nose sees now."""
    vehicle = body.vehicle
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    nose = vehicle.box_offset + 0.5 * vehicle.length
    x, y = body.x + nose * cos, body.y + nose * sin
    reach = REACH_LENGTHS * vehicle.length
    walls = around.borders_near(x, y, reach)
    karts = np.concatenate([_box(row, vehicle) for row in around.others] or [np.zeros((0, 4))])
    segments = np.concatenate([walls, karts])
    kinds = np.array([codes.BORDER] * len(walls) + [codes.KART_HIT] * len(karts), np.uint8)
    drift = np.concatenate([np.zeros((len(walls), 2)), np.repeat(around.others[:, 3:], 4, axis=0)])
    angles = BEAMS + body.heading
    ranges, which = cast(x, y, np.cos(angles), np.sin(angles), segments, reach)
    hit, bearings = which >= 0, BEAMS.copy()
    seen_kinds = np.where(hit, kinds[which] if len(kinds) else 0, 0).astype(np.uint8)
    moving = drift[which] if len(drift) else np.zeros((len(BEAMS), 2))
    moving = np.where(hit[:, None], moving, 0.0)
    for person in around.people:
        _see_person(person, x, y, body.heading, ranges, bearings, seen_kinds, moving)
    seen = seen_kinds > 0
    ranges = ranges + chance.normal(0.0, 0.002 * vehicle.length, len(ranges))
    ways = bearings + body.heading
    own_x = body.speed * cos - body.lateral_speed * sin
    own_y = body.speed * sin + body.lateral_speed * cos
    closing = (own_x - moving[:, 0]) * np.cos(ways) + (own_y - moving[:, 1]) * np.sin(ways)
    return Echoes(
        x=(vehicle.rear_axle + nose + ranges * np.cos(bearings))[seen],
        y=(ranges * np.sin(bearings))[seen],
        closing=closing[seen],
        kinds=seen_kinds[seen],
    )


def cast(
    x: float, y: float, cos: Floats, sin: Floats, segments: Floats, reach: float
) -> tuple[Floats, NDArray[np.int64]]:
    """Return range [m] and number of the first of some segments (S, 4) along each ray.

    The number is -1 and the range `reach` where there is none.
    """
    if len(segments) == 0:
        return np.full(len(cos), reach), np.full(len(cos), -1)
    dx, dy = segments[:, 0] - x, segments[:, 1] - y
    ex, ey = segments[:, 2] - segments[:, 0], segments[:, 3] - segments[:, 1]
    across = cos[:, None] * ey - sin[:, None] * ex
    with np.errstate(divide="ignore", invalid="ignore"):
        ranges = (dx * ey - dy * ex) / across
        share = (dx * sin[:, None] - dy * cos[:, None]) / across
    good = (across != 0.0) & (ranges >= 0.0) & (share >= 0.0) & (share <= 1.0)
    ranges = np.where(good, ranges, np.inf)
    which = np.argmin(ranges, axis=1)
    nearest = ranges[np.arange(len(cos)), which]
    return np.minimum(nearest, reach), np.where(nearest < reach, which, -1)


def _box(row: Floats, vehicle: Vehicle) -> Floats:
    """Return the four sides of a kart's body."""
    x, y, heading = row[:3]
    cos, sin = math.cos(heading), math.sin(heading)
    front = vehicle.box_offset + 0.5 * vehicle.length
    rear, side = front - vehicle.length, 0.5 * vehicle.width
    corners = np.array([(front, side), (rear, side), (rear, -side), (front, -side)])
    points = corners @ np.array([(cos, sin), (-sin, cos)]) + (x, y)
    return np.concatenate([points, np.roll(points, -1, axis=0)], axis=1)


def _see_person(
    person: Person,
    x: float,
    y: float,
    heading: float,
    ranges: Floats,
    bearings: Floats,
    kinds: NDArray[np.uint8],
    moving: Floats,
) -> None:
    """Let the beam that points at a person see it."""
    dx, dy = person.x - x, person.y - y
    bearing = math.remainder(math.atan2(dy, dx) - heading, 2.0 * math.pi)
    distance = max(math.hypot(dx, dy) - person.radius, 0.0)
    beam = int(np.argmin(np.abs(BEAMS - bearing)))
    if abs(bearing) <= BEAMS[-1] and distance < ranges[beam]:
        ranges[beam], bearings[beam], kinds[beam] = distance, bearing, codes.OBSTACLE
        moving[beam] = 0.0


def gap_to(person: Person, body: Body) -> float:
    """Return the distance [m] between a person and a kart's body."""
    vehicle = body.vehicle
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    dx, dy = person.x - body.x, person.y - body.y
    along = max(abs(dx * cos + dy * sin - vehicle.box_offset) - 0.5 * vehicle.length, 0.0)
    across = max(abs(dy * cos - dx * sin) - 0.5 * vehicle.width, 0.0)
    return math.hypot(along, across) - person.radius
