"""Files of car parks: found by name, read value by value."""

import hashlib
import math
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from race_server.core.bounds import LEAST_ROUND_S, MOST_ROUND_S
from race_server.core.lots import ROLES
from race_server.core.vehicle_presets import vehicle_named
from race_server.errors import LotError, VehicleError
from race_server.scenario.level import LEVELS
from race_server.scenario.lot.faults import faults_of
from race_server.scenario.lot.generated import FORMS, generated_file
from race_server.scenario.lot.site import area_in, course_of_lot, polygons_in
from race_server.scenario.places import names_of, path_of
from race_server.scenario.text_files import MOST_TOML, parse_toml, read_text
from race_server.scenario.toml_reader import MOST_LETTERS, TomlReader, bytes_of_name
from race_server.scenario.track.course import Course, Obstacle
from race_server.scenario.track.generated import PREFIX
from race_server.scenario.track.limits import (
    MOST_BLOCKS,
    MOST_OBSTACLES,
    MOST_PEOPLE,
    MOST_SLOT_ROWS,
    MOST_ZONES,
)
from race_server.scenario.track.lot import Blocks, Floats, Lot, People, Taken, Zone
from race_server.scenario.track.polyline import area_of, corners_of_box, crossings, segments_of
from race_server.scenario.track.slots import slots_in

Area = tuple[float, float, float, float]  # x0, x1, y0, y1 [m]

MOST_ROWS = {
    "obstacles": MOST_OBSTACLES,
    "walls": MOST_OBSTACLES,
    "polygons": MOST_OBSTACLES,
    "rows": MOST_SLOT_ROWS,
    "zones": MOST_ZONES,
}
MOST_CORNERS = 64  # of a polygon
BEYOND = 50.0  # [m] that an obstacle may reach out of the area
LARGEST = 500.0  # [m] of one side of the area
FARTHEST = 1000.0  # [m] from the origin to a side of the area: observations tell no more
WALL = 0.1  # [m] thickness of a wall
LEAST_SQUARE = 1e-4  # [m²] of a polygon


def lot_names() -> list[str]:
    """Return the names of all lots that can be found."""
    return names_of("lots")


def load_lot(name: str | Path) -> Course:
    """Return the car park of a name, or of a path that ends in ``.toml``, as a course.

    ``generated:yard:17`` is a random one, see `race_server.scenario.lot.generated`.

    Raises:
        LotError: there is no such lot, or its file is not valid.
    """
    name = str(name)
    if name.startswith(PREFIX):
        return lot_of(name, name, generated_file(name))
    path = path_of("lots", name)
    if path is not None:
        return lot_of(path.stem, path.name, read_text(path, MOST_TOML, LotError))
    known = ", ".join(lot_names())
    raise LotError(
        f"lot {name!r} is unknown; choose one of {known}, give a .toml file, or a generated lot: "
        f"{', '.join(FORMS)}"
    )


@cache
def lot_of(name: str, file: str, text: str) -> Course:
    """Return the car park of a text as a course. file: what errors call it.

    Raises:
        LotError: the text is not valid.
    """
    try:
        words = parse_toml(text)
    except ValueError as error:
        raise LotError(f"{file}: no TOML: {error}") from error
    reader = TomlReader(file, words, LotError, "lots/README.md", MOST_ROWS)
    title = reader.text("title", name[:MOST_LETTERS])
    area = _area(reader)
    obstacles = (*_walls(reader, area), *_obstacles(reader, area))
    polygons = _polygons(reader, area)
    lot = Lot(
        slots=slots_in(reader, "rows"),
        zones=tuple(_zone(one, area) for one in reader.tables("zones")),
        slot_size=reader.pair("slot") or (3.0, 2.0),
        distance=_distance(reader),
        taken=_taken(reader.table("taken")),
        blocks=_blocks(reader.table("blocks")),
        people=_people(reader.table("people")),
        vehicle=reader.text("vehicle", "kart-13"),
        limit_s=reader.number("limit_s", 60.0, LEAST_ROUND_S, MOST_ROUND_S),
        level=reader.choice("level", tuple(LEVELS), "parked"),
        from_slots=reader.yes("from_slots"),
    )
    reader.no_more()
    digest = hashlib.sha256(bytes_of_name(name, file, LotError) + text.encode()).hexdigest()[:16]
    course = course_of_lot(name, title, area, obstacles, lot, digest, polygons)
    try:
        vehicle = vehicle_named(lot.vehicle)
    except VehicleError as error:
        raise LotError(f"{file}: {error}") from error
    for fault in faults_of(course, vehicle):
        raise LotError(f"{file}: {fault}")
    return course


def _area(reader: TomlReader) -> Area:
    if "area" not in reader.words:
        place = ": this is the file of a track" if "form" in reader.words else ""
        raise LotError(f"{reader.file}: area is missing{place}: give x0, x1, y0, y1 [m]")
    x0, x1, y0, y1 = reader.row("area", reader.take("area", None), 4)
    for low, high in ((x0, x1), (y0, y1)):
        if not 1.0 <= high - low <= LARGEST:
            way_out = f"give x0, x1, y0, y1 with sides of 1 to {LARGEST:g} m"
            raise reader.wrong("area", [x0, x1, y0, y1], way_out)
        if max(-low, high) > FARTHEST:
            way_out = f"stay within {FARTHEST:g} m of the origin"
            raise reader.wrong("area", [x0, x1, y0, y1], way_out)
    return x0, x1, y0, y1


def _distance(reader: TomlReader) -> tuple[float, float]:
    nearest, farthest = reader.pair("distance") or (0.0, 0.0)
    if nearest < 0.0 or (farthest != 0.0 and farthest <= nearest):
        way_out = "give nearest and farthest, the second larger, or 0 for no limit"
        raise reader.wrong("distance", [nearest, farthest], way_out)
    return nearest, farthest


def _check_near(reader: TomlReader, key: str, value: object, corners: Floats, area: Area) -> None:
    """Check that corners (N, 2) [m] of what `value` describes do not lie far out of the area."""
    low, high = np.array(area[::2]) - BEYOND, np.array(area[1::2]) + BEYOND
    if (corners < low).any() or (corners > high).any():
        raise reader.wrong(key, value, f"stay within {BEYOND:g} m of the area")


def _walls(reader: TomlReader, area: Area) -> list[Obstacle]:
    walls = []
    for number, row in enumerate(reader.rows("walls", 4, np.zeros((0, 4))), start=1):
        x0, y0, x1, y1 = row.tolist()
        _check_near(reader, f"walls[{number}]", [x0, y0, x1, y1], row.reshape(2, 2), area)
        length = math.hypot(x1 - x0, y1 - y0)
        if not length:
            raise reader.wrong(f"walls[{number}]", row.tolist(), "both ends are one point")
        heading = math.atan2(y1 - y0, x1 - x0)
        walls.append(Obstacle(0.5 * (x0 + x1), 0.5 * (y0 + y1), heading, length + WALL, WALL))
    return walls


def _obstacles(reader: TomlReader, area: Area) -> list[Obstacle]:
    obstacles = []
    rows = reader.rows("obstacles", 5, np.zeros((0, 5))).tolist()
    for number, (x, y, turn, *size) in enumerate(rows, start=1):
        key = f"obstacles[{number}]"
        if min(size) <= 0.0:
            raise reader.wrong(key, size, "length and width are positive")
        box = x, y, math.radians(turn), *size
        _check_near(reader, key, [x, y, turn, *size], corners_of_box(*box), area)
        obstacles.append(Obstacle(*box))
    return obstacles


def _polygons(reader: TomlReader, area: Area) -> list[Floats]:
    """Return the corners of all polygons, each clockwise: what is free is on the left of a side."""
    loops = reader.take("polygons", [])
    most = MOST_ROWS["polygons"]
    if not isinstance(loops, list) or len(loops) > most:
        raise reader.wrong("polygons", loops, f"give a list of up to {most} lists of points")
    polygons = []
    for number, loop in enumerate(loops, start=1):
        key = f"polygons[{number}]"
        if not isinstance(loop, list) or not 3 <= len(loop) <= MOST_CORNERS:
            raise reader.wrong(key, loop, f"give 3 to {MOST_CORNERS} points [x, y]")
        corners = np.array([reader.row(f"{key}[{n}]", one, 2) for n, one in enumerate(loop, 1)])
        _check_near(reader, key, loop, corners, area)
        if len(crossings(segments_of(corners), first_only=True)):
            raise reader.wrong(key, loop, "its sides cross; give its corners in order")
        if abs(area_of(corners)) < LEAST_SQUARE:
            raise reader.wrong(key, loop, "its corners lie on one line; give an area, or a wall")
        polygons.append(corners[::-1] if area_of(corners) > 0.0 else corners)
    return polygons


def _zone(reader: TomlReader, area: Area) -> Zone:
    role = reader.choice("role", tuple(ROLES), "")
    x, y = reader.pair("x") or area[:2], reader.pair("y") or area[2:]
    for name, (low, high), (least, most) in (("x", x, area[:2]), ("y", y, area[2:])):
        if low > high:
            raise reader.wrong(name, [low, high], "give the smaller one first")
        if not least <= low <= high <= most:
            raise reader.wrong(name, [low, high], f"stay within the area, {least:g} to {most:g}")
    heading, spread, hitch = (
        math.radians(reader.number(name, 0.0, -360.0, 360.0))
        for name in ("heading", "spread", "hitch")
    )
    reader.no_more()
    return Zone(role, x, y, heading, abs(spread), abs(hitch))


def _taken(reader: TomlReader) -> Taken:
    taken = Taken(
        reader.number("share", 0.0, 0.0, 1.0),
        reader.number("length", 4.7, 0.1, 50.0),
        reader.number("width", 1.9, 0.1, 20.0),
    )
    reader.no_more()
    return taken


def _blocks(reader: TomlReader) -> Blocks:
    fewest, most = reader.pair("count") or (0.0, 0.0)
    is_whole = fewest.is_integer() and most.is_integer()
    if not (is_whole and 0 <= fewest <= most <= MOST_BLOCKS):
        way_out = f"give fewest and most, whole numbers from 0 to {MOST_BLOCKS}"
        raise reader.wrong("count", [fewest, most], way_out)
    shortest, longest = reader.pair("side") or (1.0, 2.0)
    if not 0.05 <= shortest <= longest <= 50.0:
        raise reader.wrong("side", [shortest, longest], "give shortest and longest, 0.05 to 50 m")
    reader.no_more()
    return Blocks((int(fewest), int(most)), (shortest, longest))


def _people(reader: TomlReader) -> People:
    slowest, fastest = reader.pair("speed") or (0.8, 1.6)
    if not 0.0 < slowest <= fastest <= 10.0:
        raise reader.wrong("speed", [slowest, fastest], "give slowest and fastest, up to 10 m/s")
    people = People(
        reader.whole("count", 0, 0, MOST_PEOPLE),
        (slowest, fastest),
        reader.number("radius", 0.3, 0.05, 1.0),
        reader.number("stops", 0.5, 0.0, 1.0),
        reader.number("rest_s", 3.0, 0.0, 60.0),
    )
    reader.no_more()
    return people


def summary(course: Course) -> dict[str, Any]:
    """Return the figures of a car park as plain data."""
    lot = course.lot
    assert lot is not None
    return {
        "name": course.name,
        "title": course.title,
        "vehicle": lot.vehicle,
        "level": lot.level,
        "limit_s": lot.limit_s,
        "size_m": [round(float(side), 3) for side in np.ptp(area_in(course)[:, :2], axis=0)],
        "slots": len(lot.slots),
        "taken": lot.taken.share,
        "blocks": list(lot.blocks.count),
        "people": lot.people.count,
        "obstacles": len(course.obstacles),
        "polygons": len(polygons_in(course)),
    }
