"""What stands around a kart that exists, and what its radar sees of it."""

import math
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from race_agents.plant.body import Body
from race_agents.unit.safety import Echoes
from race_server.core import codes
from race_server.core.vehicles import Vehicle
from race_server.scenario.track.raycast import are_near, first_met

Floats = NDArray[np.float64]

# A beam every 3° from -60° to 60°. Nine thin rays would see past a person 3 m away.
BEAMS = np.radians(np.linspace(-60.0, 60.0, 41))
REACH_LENGTHS = 30.0  # kart lengths


@dataclass
class Person:
    """A person or a thing on the track, which stands or walks."""

    x: float
    y: float
    radius: float
    vx: float = 0.0  # [m/s] east
    vy: float = 0.0  # [m/s] north


@dataclass(frozen=True)
class RadarErrors:
    """How a radar errs, beside the noise of its ranges."""

    clutter: float = 0.0  # stray echoes in a scan, in the mean
    misses: float = 0.0  # share of echoes that never come
    confusion: float = 0.0  # share of echoes taken for something else
    ghosts: float = 0.0  # share of scans with an echo mirrored in a border
    closing_deviation: float = 0.0  # [m/s]
    bearing_deviation: float = 0.0  # [rad]


PERFECT = RadarErrors()
# A stray echo in ten scans, and a tenth of all echoes missing.
ERRS = RadarErrors(
    clutter=0.1,
    misses=0.1,
    confusion=0.01,
    ghosts=0.02,
    closing_deviation=0.1,
    bearing_deviation=0.01,
)
# What stray echoes are taken for, and how fast they seem to come [m/s].
STRAY_KINDS = np.array([codes.BORDER, codes.OBSTACLE, codes.KART_HIT], np.uint8)
STRAY_SPEED = 5.0


@dataclass
class Surroundings:
    """Borders, other karts, people."""

    borders: Floats  # (P, 4), and the sides of what stands in a car park
    others: Floats = field(default_factory=lambda: np.zeros((0, 5)))  # x, y, heading, vx, vy
    people: list[Person] = field(default_factory=list)

    def borders_near(self, x: float, y: float, reach: float) -> Floats:
        """Return the borders that may come within `reach` [m] of a point."""
        return np.asarray(self.borders[are_near(self.borders, x, y, reach)])


def scan(
    body: Body,
    around: Surroundings,
    chance: np.random.Generator,
    errors: RadarErrors = PERFECT,
) -> Echoes:
    """Return what the radar in the nose sees now."""
    vehicle = body.vehicle
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    nose = vehicle.box_offset + 0.5 * vehicle.length
    x, y = body.x + nose * cos, body.y + nose * sin
    reach = REACH_LENGTHS * vehicle.length
    walls = around.borders_near(x, y, reach)
    # No beam meets what lies behind the radar with both ends.
    ends = walls.reshape(-1, 2, 2) - (x, y)
    walls = walls[(ends @ (cos, sin) > 0.0).any(axis=1)]
    karts = outlines_of(around.others, vehicle)
    segments = np.concatenate([walls, karts])
    kinds = np.array([codes.BORDER] * len(walls) + [codes.KART_HIT] * len(karts), np.uint8)
    drift = np.concatenate([np.zeros((len(walls), 2)), np.repeat(around.others[:, 3:], 4, axis=0)])
    ranges, which = first_met(segments, x, y, BEAMS + body.heading, reach)
    hit, bearings = which >= 0, BEAMS.copy()
    seen_kinds = np.where(hit, kinds[which] if len(kinds) else 0, 0).astype(np.uint8)
    moving = drift[which] if len(drift) else np.zeros((len(BEAMS), 2))
    moving = np.where(hit[:, None], moving, 0.0)
    for person in around.people:
        _see_person(person, x, y, body.heading, ranges, bearings, seen_kinds, moving)
    seen = seen_kinds > 0
    ranges = ranges + chance.normal(0.0, 0.002 * vehicle.length, len(ranges))
    ways = bearings + body.heading
    aside = body.lateral_speed + nose * body.yaw_rate
    own_x, own_y = body.speed * cos - aside * sin, body.speed * sin + aside * cos
    closing = (own_x - moving[:, 0]) * np.cos(ways) + (own_y - moving[:, 1]) * np.sin(ways)
    rows = np.stack([ranges, bearings, closing], axis=1)[seen]
    rows, met = disturb(rows, seen_kinds[seen], reach, errors, chance)
    return Echoes(
        x=vehicle.rear_axle + nose + rows[:, 0] * np.cos(rows[:, 1]),
        y=rows[:, 0] * np.sin(rows[:, 1]),
        closing=rows[:, 2],
        kinds=met,
    )


def disturb(
    rows: Floats,
    kinds: NDArray[np.uint8],
    reach: float,
    errors: RadarErrors,
    chance: np.random.Generator,
) -> tuple[Floats, NDArray[np.uint8]]:
    """Return echoes as a radar that errs tells them.

    rows: (n, 3) range [m], bearing [rad], closing speed [m/s].
    """
    if errors is PERFECT:
        return rows, kinds
    kept = chance.random(len(rows)) >= errors.misses
    rows, kinds = rows[kept].copy(), kinds[kept].copy()
    rows[:, 1] += chance.normal(0.0, errors.bearing_deviation, len(rows))
    rows[:, 2] += chance.normal(0.0, errors.closing_deviation, len(rows))
    confused = chance.random(len(rows)) < errors.confusion
    kinds[confused] = chance.choice(STRAY_KINDS, int(confused.sum()))
    stray = [rows[:0]]
    for _ in range(chance.poisson(errors.clutter)):
        # Evenly over the area: the farther, the more there is.
        far, bearing = reach * math.sqrt(chance.random()), chance.uniform(BEAMS[0], BEAMS[-1])
        closing = chance.uniform(-STRAY_SPEED, 3.0 * STRAY_SPEED)
        stray.append(np.array([[far, bearing, closing]]))
    if len(rows) and chance.random() < errors.ghosts:
        ghost = rows[int(chance.integers(len(rows)))].copy()
        ghost[0] *= 0.6  # the way by the mirror is cut short, or seems to be
        ghost[1] = -ghost[1]
        stray.append(ghost[None])
    strays = np.concatenate(stray)
    drawn = chance.choice(STRAY_KINDS, len(strays)).astype(np.uint8)
    return np.concatenate([rows, strays]), np.concatenate([kinds, drawn])


def scan_all_around(body: Body, around: Surroundings, angles: Floats, reach: float) -> Floats:
    """Return what a lidar over the centre of gravity sees: ranges (R,) [m], 0 for nothing.

    angles: (R,) [rad] of its rays, from straight ahead.
    """
    walls = around.borders_near(body.x, body.y, reach)
    karts = outlines_of(around.others, body.vehicle)
    segments, ways = np.concatenate([walls, karts]), angles + body.heading
    ranges, _ = first_met(segments, body.x, body.y, ways, reach)
    for person in around.people:
        ranges = np.minimum(ranges, _range_of_disc(person, body.x, body.y, ways))
    return np.where(ranges < reach, ranges, 0.0)


def _range_of_disc(person: Person, x: float, y: float, angles: Floats) -> Floats:
    """Return how far [m] it is to a disc along rays from (x, y), (R,), infinity beside it."""
    dx, dy = person.x - x, person.y - y
    along = dx * np.cos(angles) + dy * np.sin(angles)
    square = person.radius**2 - (dx * dx + dy * dy - along * along)
    is_met = (square >= 0.0) & (along > 0.0)
    half = np.sqrt(np.maximum(square, 0.0))
    return np.where(is_met, np.maximum(along - half, 0.0), np.inf)


def outlines_of(rows: Floats, vehicle: Vehicle) -> Floats:
    """Return the sides of karts' bodies, four of each, (4 n, 4): x0, y0, x1, y1 [m].

    rows: (n, 3 or more) x, y, heading of each kart.
    """
    cos, sin = np.cos(rows[:, 2, None]), np.sin(rows[:, 2, None])
    half = 0.5 * vehicle.width
    ahead = vehicle.box_offset + 0.5 * vehicle.length * np.array([1.0, -1.0, -1.0, 1.0])
    left = np.array([half, half, -half, -half])
    x, y = rows[:, 0, None] + ahead * cos - left * sin, rows[:, 1, None] + ahead * sin + left * cos
    corners = np.stack([x, y], axis=2)
    return np.concatenate([corners, np.roll(corners, -1, axis=1)], axis=2).reshape(-1, 4)


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
    """Add a person to the beam that points at it."""
    dx, dy = person.x - x, person.y - y
    bearing = math.remainder(math.atan2(dy, dx) - heading, 2.0 * math.pi)
    distance = max(math.hypot(dx, dy) - person.radius, 0.0)
    beam = int(np.argmin(np.abs(BEAMS - bearing)))
    if abs(bearing) <= BEAMS[-1] and distance < ranges[beam]:
        ranges[beam], bearings[beam], kinds[beam] = distance, bearing, codes.PERSON
        moving[beam] = person.vx, person.vy


def gap_to(person: Person, body: Body) -> float:
    """Return the distance [m] between a person and a kart's body."""
    vehicle = body.vehicle
    cos, sin = math.cos(body.heading), math.sin(body.heading)
    dx, dy = person.x - body.x, person.y - body.y
    along = max(abs(dx * cos + dy * sin - vehicle.box_offset) - 0.5 * vehicle.length, 0.0)
    across = max(abs(dy * cos - dx * sin) - 0.5 * vehicle.width, 0.0)
    return math.hypot(along, across) - person.radius
