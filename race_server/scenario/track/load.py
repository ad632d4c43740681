"""Track files: found by name, read value by value, built once and cached."""

import hashlib
import math
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from race_server.errors import TrackError
from race_server.scenario.places import names_of, own_folder, path_of
from race_server.scenario.text_files import MOST_TOML, parse_toml, read_text
from race_server.scenario.toml_reader import MOST_LETTERS, TomlReader, bytes_of_name, is_number
from race_server.scenario.track.blocks import Loop
from race_server.scenario.track.build import GATES, SCALES, SECTORS, TrackSpec, build
from race_server.scenario.track.cache import cached
from race_server.scenario.track.course import Course, Floats, Obstacle
from race_server.scenario.track.generated import FORMS as DRAWN
from race_server.scenario.track.generated import PREFIX, generated_file
from race_server.scenario.track.highway_roads import PREFIX as HIGHWAY
from race_server.scenario.track.highway_roads import highway_file
from race_server.scenario.track.limits import (
    MOST_GATES,
    MOST_HALF_WIDTH,
    MOST_ITEMS,
    MOST_OBSTACLES,
    MOST_PLACES,
    MOST_POINTS,
    MOST_SLOT_ROWS,
    MOST_STARTS,
)
from race_server.scenario.track.slots import slots_in

FORMS = ("blocks", "line", "spline")
MOST_ROWS = {
    "points": MOST_POINTS,
    "items": MOST_ITEMS,
    "obstacles": MOST_OBSTACLES,
    "starts": MOST_STARTS,
    "slots": MOST_SLOT_ROWS,
}


def own_tracks() -> Path:
    """Return the folder of the bundled tracks."""
    return own_folder("tracks")


def track_names() -> list[str]:
    """Return the names of all tracks that can be found."""
    return names_of("tracks")


def load_course(name: str) -> Course:
    """Return the course of a name, or of a path that ends in ``.toml``.

    ``generated:block:17`` is a random course, see `race_server.scenario.track.generated`.

    Raises:
        TrackError: there is no such course, or its file is not valid.
    """
    return course_in(*_source_of(name))


def digest_of(name: str) -> str:
    """Return the digest of a course without building it.

    Raises:
        TrackError: as of `load_course`.
    """
    return spec_of(*_source_of(name)).digest


def _source_of(name: str) -> tuple[str, str, bytes]:
    """Return the course's own name, and the name and content of its file."""
    if name.startswith(PREFIX) and not name.endswith(".toml"):
        return name, name, generated_file(name)
    if name.startswith(HIGHWAY) and not name.endswith(".toml"):
        return name, name, highway_file(name)
    path = path_of("tracks", name)
    if path is not None:
        return _source_in(path)
    known = ", ".join(track_names())
    raise TrackError(
        f"track {name!r} is unknown; choose one of {known}, give a .toml file, "
        f"or a generated course: {', '.join(DRAWN)}"
    )


def read_course(path: Path) -> Course:
    """Return the course that a file describes.

    Raises:
        TrackError: it cannot be read or describes no course.
    """
    return course_in(*_source_in(path))


def _source_in(path: Path) -> tuple[str, str, bytes]:
    return path.stem, path.name, read_text(path, MOST_TOML, TrackError).encode()


@cache
def course_in(name: str, file: str, data: bytes) -> Course:
    """Return the course that the content of a file describes.

    name: of the course; file: named where something is wrong.

    Raises:
        TrackError: it describes no course.
    """
    plan = spec_of(name, file, data)
    try:
        return cached(plan.digest, lambda: build(plan))
    except TrackError as error:
        raise TrackError(f"{file}: {error}") from error


def spec_of(name: str, file: str, data: bytes) -> TrackSpec:
    """Return the content of a track file.

    Raises:
        TrackError: names file, key and value of what is wrong.
    """
    try:
        words = parse_toml(data.decode())
    except ValueError as error:
        raise TrackError(f"{file}: no TOML: {error}") from error
    reader = _TrackReader(file, words, TrackError, "tracks/README.md", MOST_ROWS)
    if "area" in words and "form" not in words:
        raise TrackError(f"{file}: form is missing: this is the file of a car park, see race lot")
    form = reader.choice("form", FORMS, "")
    plan = TrackSpec(
        name=name,
        title=reader.text("title", name[:MOST_LETTERS]),
        form=form,
        scale=reader.choice("scale", tuple(SCALES), "1/10"),
        digest=hashlib.sha256(bytes_of_name(name, file, TrackError) + data).hexdigest()[:16],
        outer=reader.loop("outer") if form == "blocks" else None,
        inner=reader.loop("inner") if form == "blocks" else None,
        points=reader.points() if form != "blocks" else np.zeros((0, 4)),
        reverse=reader.yes("reverse"),
        kerb=reader.number("kerb", 0.0, 0.0, 10.0),
        grass=reader.number("grass", 0.0, 0.0, 100.0),
        gates=reader.whole("gates", GATES, 3, MOST_GATES),
        sectors=reader.whole("sectors", SECTORS, 1, 20),
        line_at=reader.pair("line_at"),
        places=reader.whole("grid_places", MOST_PLACES, 1, MOST_PLACES),
        items=reader.items(),
        obstacles=tuple(reader.obstacles()),
        starts=reader.rows("starts", 6, np.zeros((0, 6))),
        slots=slots_in(reader, "slots"),
    )
    reader.no_more()
    if plan.gates < plan.sectors:
        raise TrackError(f"{file}: gates = {plan.gates} is less than sectors = {plan.sectors}")
    return plan


class _TrackReader(TomlReader):
    """The values of a track file."""

    def points(self) -> Floats:
        half_width = self.take("half_width", None)
        if half_width is None:
            points = self.rows("points", 4, np.zeros((0, 4)))
        else:
            if not is_number(half_width) or not 0.0 < half_width <= MOST_HALF_WIDTH:
                way_out = f"give metres above 0, up to {MOST_HALF_WIDTH:g}"
                raise self.wrong("half_width", half_width, way_out)
            places = self.rows("points", 2, np.zeros((0, 2)))
            points = np.hstack([places, np.full((len(places), 2), float(half_width))])
        fits = ((points[:, 2:] > 0.0) & (points[:, 2:] <= MOST_HALF_WIDTH)).all(axis=1)
        if not fits.all():
            row = int(np.argmin(fits)) + 1
            way_out = f"half-widths are above 0 and up to {MOST_HALF_WIDTH:g} m"
            raise self.wrong(f"points[{row}]", points[row - 1].tolist(), way_out)
        return points

    def loop(self, key: str) -> Loop:
        value = self.take(key, None)
        if not isinstance(value, dict):
            raise self.wrong(key, value, "give a table with start, heading and blocks")
        row = self.row(f"{key}.start", value.get("start"), 2)
        heading, blocks = value.get("heading", ""), value.get("blocks")
        if not is_number(heading):
            raise self.wrong(f"{key}.heading", heading, "give a number in degrees")
        if not isinstance(blocks, str) or not blocks.strip():
            raise self.wrong(f"{key}.blocks", blocks, "give a list such as 'S L 2xS R'")
        return Loop(key, row[0], row[1], math.radians(float(heading)), blocks)

    def items(self) -> tuple[tuple[float, float], ...] | None:
        if "items" not in self.words:
            return None
        return tuple((row[0], row[1]) for row in self.rows("items", 2, np.zeros((0, 2))))

    def obstacles(self) -> Iterable[Obstacle]:
        for x, y, degrees, length, width in self.rows("obstacles", 5, np.zeros((0, 5))):
            if min(length, width) <= 0.0:
                raise self.wrong("obstacles", (length, width), "length and width are positive")
            yield Obstacle(x, y, math.radians(degrees), length, width)


def summary(course: Course) -> dict[str, Any]:
    """Return the figures of a course as plain data."""
    return {
        "name": course.name,
        "title": course.title,
        "length_m": round(course.length, 3),
        "width_min_m": round(course.width_min, 3),
        "width_mean_m": round(course.width_mean, 3),
        "width_max_m": round(course.width_max, 3),
        "gates": len(course.gates),
        "sectors": len(course.sectors),
        "grid_places": len(course.grid),
        "item_spots": len(course.spots),
        "obstacles": len(course.obstacles),
        "slots": 0 if course.lot is None else len(course.lot.slots),
    }
