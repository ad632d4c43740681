"""The world as arrays: one record per world, body, racer, player, box and hazard.

All have a leading world axis. A record keeps its numbers side by side in memory, and a kernel is
handed ten arrays instead of a hundred. Every field is eight bytes wide, so that nothing is padded
and the bytes of a world are its digest. Axis letters: W worlds, K karts, I item boxes, H hazards,
R rays.
"""

import hashlib
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from race_server.core.lots import CarPark, bytes_of, part_of_parking
from race_server.core.records import Record as Record
from race_server.core.records import Records as Records
from race_server.core.records import fields_of, record_of
from race_server.core.vehicles import TRAILERS, VEHICLE

Floats = NDArray[np.float64]
Float32s = NDArray[np.float32]
Bytes = NDArray[np.uint8]
Ints = NDArray[np.int64]

EFFECTS = 4  # effects at a time on one kart
HAZARDS = 32  # hazards at a time on one track
EVENTS = 512  # events that one call of `advance` can report per world
RADAR_RAYS = 9


EFFECT = record_of(fields_of("speed_scale thrust_scale grip_scale", "source until_tick"))

# What of a trailer moves: its place follows from its heading and from what draws it.
TOWED = record_of(fields_of("heading yaw_rate", ""))

# One body: what moves, steers, meets others and carries sensors, in a race as in a car park. Angles
# [rad], lengths [m], speeds [m/s]; fields ending in _tick or _until are ticks.
BODY = record_of(
    [
        *fields_of(
            # Motion: position of the centre of gravity; speeds along and across the body.
            "x y heading speed lateral_speed yaw_rate steering "
            # What the driver asked for last: shares of the limits.
            "steering_command throttle brake "
            # What flags, effects and surface leave of speed [m/s], motor force and grip.
            "speed_cap thrust_scale grip_scale",
            # `contact_pairs`: bits of the bodies after it that it may meet; `sensors`: bits of
            # Sensor; `trust`: how far the pose of a real kart is believed, see Trust.
            "status buttons surface contact_pairs ghost_until sensors trust",
        ),
        ("trailers", TOWED, (TRAILERS,)),
    ]
)

# One kart's race: its place on the course, gates, laps and what the stewards watch. Fields ending
# in _us are microseconds since tick 0.
RACER = record_of(
    fields_of(
        # `distance` counts on over the laps, from a negative start; `ranked` is the part of it
        # that counts.
        "progress lateral_offset heading_error distance ranked start_x start_y backward",
        # Place on the centre line; gates and laps.
        "line_index zone next_gate started cutting laps "
        "lap_start_us sector_start_us last_lap_us best_lap_us finish_us rank grid_place "
        # What the stewards watch; `yellow` is 1 where a yellow flag is near.
        "wrong_way off_track still_ticks stopped_ticks rescue_offered lap_clean false_started "
        "contact_kart_tick contact_wall_tick contacts wall_contacts warnings "
        "penalties penalty_us retired_for yellow",
    )
)

# One kart's game: the item it holds and the effects on it.
PLAYER = record_of(
    [
        *fields_of("", "held items_used immune_until shield_until hits buttons_before"),
        ("effects", EFFECT, (EFFECTS,)),
    ]
)

# The order in which the fields of a kart enter the digest. Recordings hold digests, so a field
# keeps its place here, whichever record it is in.
HASHED = (
    "x y heading speed lateral_speed yaw_rate steering steering_command throttle brake "
    "progress lateral_offset heading_error distance ranked start_x start_y backward "
    "speed_cap thrust_scale grip_scale "
    "status buttons buttons_before line_index zone next_gate started cutting laps "
    "lap_start_us sector_start_us last_lap_us best_lap_us finish_us rank grid_place surface "
    "wrong_way off_track still_ticks stopped_ticks rescue_offered lap_clean false_started "
    "contact_pairs contact_kart_tick contact_wall_tick contacts wall_contacts warnings hits "
    "held items_used immune_until shield_until ghost_until penalties penalty_us retired_for "
    "sensors trust yellow effects"
)

RACE = record_of(
    fields_of("", "seed tick start_tick hold_until flag over finishers winner_tick sequence")
)

BOX = record_of(fields_of("x y", "ready_tick"))
HAZARD = record_of(fields_of("x y radius", "source owner until_tick owner_safe_tick"))
# Where a real kart is, as it is put into the world before a tick: columns of an array (n, 10).
PLACEMENT = (
    *("kart", "trust", "doubt", "x", "y", "heading"),
    *("speed", "lateral_speed", "yaw_rate", "steering"),
)

EVENT = record_of(fields_of("", "sequence tick kind kart other value detail"))

# Where a moving thing was when a ray met it last, and how fast it went then: see
# `stages/sightings.py`. `seen`: 1 + that tick, 0 for never.
SIGHTING = record_of(fields_of("x y speed_x speed_y", "seen"))

# What is fixed for one race. Zero switches a limit off.
RULES = record_of(
    fields_of(
        "yellow_speed restitution wall_friction pick_up_radius stuck_speed wrong_way_limit "
        "wrong_way_removal ram_speed",
        "laps course wall_contact kart_contact items catch_up standing_start ram_warnings "
        "box_respawn_ticks stuck_ticks stopped_limit_ticks finish_limit_ticks limit_ticks "
        "false_start_us short_cut_us rescue_us edition",
    )
)

# One item, as the rules read it; see `core/rules/items`.
ITEM = record_of(
    fields_of(
        "leader_weight last_weight speed_scale thrust_scale grip_scale radius",
        "use effect_ticks immunity_ticks life_ticks owner_grace_ticks",
    )
)

# The sensors of a race. Angles in the kart frame, ray 0 is the rightmost.
SENSORS = record_of(
    fields_of(
        "lidar_reach lidar_ahead lidar_field lidar_noise lidar_dropout "
        "radar_reach radar_ahead radar_field radar_noise",
        "lidar_period_ticks radar_period_ticks",
    )
)

# One place that walls stand around, and the grid over them: see `scenario/track/walls.py`.
SITE = record_of(
    fields_of(
        "cell x0 y0",
        "wall_start wall_count cell_start columns rows group_start group_count",
    )
)
GROUP = record_of(fields_of("x y radius", "first last"))
# What is driven along at a site: see `scenario/track/route.py`.
COURSE = record_of(
    fields_of(
        "spacing length kerb verge reference_spacing",
        "line_start line_count gate_start gate_count grid_start grid_count spot_start spot_count",
    )
)
LINE = record_of(fields_of("x y heading cos sin curvature left right", ""))
# A line to drive along, sampled at equal steps along itself, as many as of the centre line;
# `beside` is its sample abreast of the centre line's; for `held` see `ReferenceLine.held`. Without
# a line `reference_spacing` is zero.
REFERENCE = record_of(fields_of("x y heading cos sin curvature speed left right held", "beside"))
GATE = record_of(fields_of("progress", "sector"))


class Walls(NamedTuple):
    """The walls of all sites of a batch, one behind the other; `sites[s]` says where each begins.

    All that rays and contacts need to know of a place.
    """

    sites: Records  # (C,) SITE
    segments: Floats  # (P, 4) x0, y0, x1, y1 [m], the drivable side on the left
    kinds: Bytes  # (P,) Hit
    groups: Records  # (Q,) GROUP: circles around runs of walls
    cell_first: NDArray[np.int32]  # (cells + 1,) first entry of each cell in `cell_walls`
    cell_walls: NDArray[np.int32]  # walls that touch each cell
    cell_clear: Float32s  # (cells,) [m] between a cell and the nearest wall, at least
    cell_free: Bytes  # (cells, 8, 2) free cells along x and y for each octant of directions


class Route(NamedTuple):
    """The courses of a batch, one behind the other; `courses[c]` says where each begins."""

    courses: Records  # (C,) COURSE
    line: Records  # (N,) LINE
    reference: Records  # (N,) REFERENCE, zeros where a course has none
    gates: Records  # (G,) GATE
    grid: Floats  # (S, 3) x, y [m], heading [rad]
    spots: Floats  # (I, 2) x, y [m]


class SensorData(NamedTuple):
    """What the sensors of all karts gave last. Derived from the world: not part of its digest."""

    lidar: Float32s  # (W, K, 2, R) [m] newest scan, scan before
    radar: Float32s  # (W, K, 9) [m]
    radar_before: Float32s  # (W, K, 9) [m] the scan before
    radar_kinds: Bytes  # (W, K, 9) Hit
    # (W, K, K + P) SIGHTING of each vehicle and each person of a car park; in a race none.
    sightings: Records
    lidar_rays: Floats  # (R, 2) cosine and sine of each ray in the kart frame
    radar_rays: Floats  # (9, 2)


class World(NamedTuple):
    """W races of K karts: all that `advance` reads and writes."""

    races: Records  # (W,) RACE
    rules: Records  # (W,) RULES
    bodies: Records  # (W, K) BODY
    racers: Records  # (W, K) RACER
    players: Records  # (W, K) PLAYER
    turns: Ints  # (W, K) karts in the order of their places on the grid, see `stages/grid.py`
    vehicles: Records  # (W, K) VEHICLE
    boxes: Records  # (W, I) BOX
    hazards: Records  # (W, H) HAZARD
    events: Records  # (W, E) EVENT
    event_counts: Ints  # (W,) events since they were last taken
    items: Records  # (N,) ITEM; number 0 is no item
    sensors: Records  # (1,) SENSORS
    sight: SensorData
    walls: Walls  # `rules[w].course` is the number of a world's site, its course and its lot
    route: Route
    parking: CarPark


def empty_world(
    worlds: int,
    karts: int,
    boxes: int,
    items: Records,
    sensors: Records,
    sight: SensorData,
    walls: Walls,
    route: Route,
    parking: CarPark,
) -> World:
    """Return a world in which nothing is placed yet."""
    return World(
        races=np.zeros(worlds, RACE),
        rules=np.zeros(worlds, RULES),
        bodies=np.zeros((worlds, karts), BODY),
        racers=np.zeros((worlds, karts), RACER),
        players=np.zeros((worlds, karts), PLAYER),
        turns=np.tile(np.arange(karts), (worlds, 1)),
        vehicles=np.zeros((worlds, karts), VEHICLE),
        boxes=np.zeros((worlds, boxes), BOX),
        hazards=np.zeros((worlds, HAZARDS), HAZARD),
        events=np.zeros((worlds, EVENTS), EVENT),
        event_counts=np.zeros(worlds, np.int64),
        items=items,
        sensors=sensors,
        sight=sight,
        walls=walls,
        route=route,
        parking=parking,
    )


def empty_sightings(parking: CarPark) -> Records:
    """Return room for what each vehicle has seen of the others and of people; none in a race."""
    worlds, vehicles = parking.parkers.shape
    movers = vehicles + parking.walkers.shape[1] if vehicles else 0
    return np.zeros((worlds, vehicles, movers), SIGHTING)


def part_of(world: World, first: int, last: int) -> World:
    """Return worlds `first` to `last` (not included) as a view that shares their memory."""
    cut = slice(first, last)
    sight = world.sight._replace(
        lidar=world.sight.lidar[cut],
        radar=world.sight.radar[cut],
        radar_before=world.sight.radar_before[cut],
        radar_kinds=world.sight.radar_kinds[cut],
        sightings=world.sight.sightings[cut],
    )
    return world._replace(
        races=world.races[cut],
        rules=world.rules[cut],
        bodies=world.bodies[cut],
        racers=world.racers[cut],
        players=world.players[cut],
        turns=world.turns[cut],
        vehicles=world.vehicles[cut],
        boxes=world.boxes[cut],
        hazards=world.hazards[cut],
        events=world.events[cut],
        event_counts=world.event_counts[cut],
        sight=sight,
        parking=part_of_parking(world.parking, cut),
    )


def _hashed_columns() -> Ints:
    """Return the places of the numbers of `HASHED` in a kart's records, laid end to end."""
    columns: dict[str, range] = {}
    first = 0
    for record in (BODY, RACER, PLAYER):
        for name in record.names or ():
            last = first + record[name].itemsize // 8
            columns[name] = range(first, last)
            first = last
    return np.array([column for name in HASHED.split() for column in columns[name]], np.int64)


_HASHED_COLUMNS = _hashed_columns()


def hashed_karts(world: World, index: int = 0) -> Ints:
    """Return the karts of one world, shape (K, n), as the digest takes them: see `HASHED`."""
    records = (world.bodies[index], world.racers[index], world.players[index])
    numbers = [np.ascontiguousarray(rows).view(np.int64) for rows in records]
    karts = len(world.bodies[index])
    return np.concatenate([row.reshape(karts, -1) for row in numbers], axis=1)[:, _HASHED_COLUMNS]


def field_of(world: World, name: str) -> Records:
    """Return a field of all karts, shape (W, K), from the record that has it.

    Raises:
        KeyError: no record has such a field.
    """
    for records in (world.bodies, world.racers, world.players):
        if name in (records.dtype.names or ()):
            return records[name]
    raise KeyError(name)


def _trailers_of(world: World, index: int) -> list[bytes]:
    """Return what the digest of one world takes of trailers; nothing of a vehicle without any."""
    counts = world.vehicles["trailer_count"][index]
    trailers = world.bodies["trailers"][index]
    return [trailers[kart, : counts[kart]].tobytes() for kart in np.flatnonzero(counts).tolist()]


def digest(world: World, index: int = 0) -> str:
    """Return a digest of one world: equal for equal seeds and inputs on every machine."""
    result = hashlib.blake2b(digest_size=16)
    result.update(np.ascontiguousarray(world.races[index]).tobytes())
    result.update(hashed_karts(world, index).tobytes())
    for content in _trailers_of(world, index):
        result.update(content)
    for records in (world.boxes, world.hazards):
        result.update(np.ascontiguousarray(records[index]).tobytes())
    for content in bytes_of(world.parking, index):
        result.update(content)
    return result.hexdigest()
