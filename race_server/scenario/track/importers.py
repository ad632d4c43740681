"""Convert courses of other formats into track files."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import numpy as np

from race_server.errors import TrackError
from race_server.kept_file import write_together
from race_server.printable import printable
from race_server.scenario.toml_reader import MOST_LETTERS
from race_server.scenario.track.build import SCALES, scale_for
from race_server.scenario.track.corridor import Corridor, find_corridor, other_loops
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.highway_roads import PREFIX as HIGHWAY
from race_server.scenario.track.highway_roads import highway_file
from race_server.scenario.track.load import course_in
from race_server.scenario.track.occupancy_map import OccupancyMap, read_map
from race_server.scenario.track.polyline import lengths_of
from race_server.scenario.track.ros_map import points_in
from race_server.scenario.track.tum import read_tum

MAPS = (".yaml", ".yml")
# Ends the name of a map that is kept beside a course: `ring.map.yaml` beside `ring.toml`.
MAP_BESIDE = ".map.yaml"
# A table is open where its last point is more than this number of the longest steps from the first.
OPEN = 3.0
# Courses are wider than this [m] only where lengths were taken for another unit.
WIDEST = 40.0
# Takes the share of the work that is done.
Report = Callable[[float], None]


@dataclass(frozen=True)
class Imported:
    """A course that was written, and the size of the karts that it was written for."""

    course: Course
    scale: str
    likely_scale: str  # of a course of this width
    remark: str = ""  # on what may be wrong with it


def import_course(
    source: Path,
    target: Path,
    *,
    title: str,
    scale: str = "",
    report: Report = lambda share: None,
) -> Imported:
    """Write the course of a TUM CSV or of a ROS map's YAML as a track file, and return it.

    A map is kept beside the file, to check the course against. scale: empty for the one that the
    width speaks for.

    Raises:
        TrackError: the source is neither, or holds no course, or another map lies beside the file;
            no file is written then.
    """
    if scale and scale not in SCALES:
        raise TrackError(f"scale {scale!r} is unknown; choose one of {', '.join(SCALES)}")
    if source.suffix.lower() not in MAPS:
        check_no_map(target)
    if str(source).startswith(HIGHWAY):
        return _import_highway(str(source), target, scale)
    if source.suffix.lower() not in {".csv", *MAPS}:
        raise TrackError(
            f"{source}: import a TUM .csv, the .yaml of a ROS map, or {HIGHWAY}racetrack-v0"
        )
    report(0.0)
    occupancy = read_map(source) if source.suffix.lower() in MAPS else None
    report(0.1)
    corridor = find_corridor(occupancy) if occupancy else None
    points = points_in(occupancy, corridor) if occupancy and corridor else read_tum(source)
    report(0.3)
    width = float(points[:, 2:].sum(axis=1).mean())
    likely = scale_for(width)
    words = line_file(points, f"Imported from {source.name}", scale or likely, title).encode()
    try:
        course = course_in(target.stem, target.name, words)
    except TrackError as error:
        said = str(error).removeprefix(f"{target.name}: ").removeprefix(f"{target.stem}: ")
        raise TrackError(f"{source}: {said}") from error
    report(0.9)
    files = {}
    if occupancy is not None:
        _check_line(course, occupancy)
        files = _kept_map(occupancy, target)
    files[target] = words
    _write(files, target)
    report(1.0)
    return Imported(course, scale or likely, likely, _remark_on(points, width, corridor))


def _import_highway(name: str, target: Path, scale: str) -> Imported:
    """Write the roads of highway-env of a name as a course; model cars get a tenth of them."""
    words = highway_file(name.removesuffix(":tenth") + ":tenth" * (scale == "1/10"))
    course = course_in(target.stem, target.name, words)
    _write({target: words}, target)
    used = scale or "kart"
    return Imported(course, used, used)


def _write(files: Mapping[Path, bytes], target: Path) -> None:
    try:
        write_together(files)
    except OSError as error:
        raise TrackError(f"{target}: cannot be written: {error.strerror}") from error


def line_file(points: Floats, origin: str, scale: str, title: str) -> str:
    """Return the content of a course file of the form `line`.

    points: (N, 4) x, y, half-width left, half-width right [m]; origin: words on its first line.
    """
    origin = printable(" ".join(origin.split()))
    clean = "".join(letter for letter in title if letter.isprintable() and letter not in '"\\')
    rows = [f"    [{x:.4f}, {y:.4f}, {left:.4f}, {right:.4f}]," for x, y, left, right in points]
    head = [
        f"# {origin}. Points: x, y, half-width left, half-width right [m].",
        "",
        f'title = "{clean[:MOST_LETTERS] or "Imported"}"',
        'form = "line"',
        f'scale = "{scale}"',
        "points = [",
    ]
    return "\n".join([*head, *rows, "]", ""])


def check_no_map(target: Path) -> None:
    """Check that no map lies beside a course file that is to be made of something else.

    Raises:
        TrackError: there is one, with which the course would be compared.
    """
    if (beside := map_beside(target)) is not None:
        raise TrackError(
            f"{beside}: the map of another course, with which {target.name} would be compared; "
            "remove it, or write the course under another name"
        )


def _check_line(course: Course, occupancy: OccupancyMap) -> None:
    """Check that the course runs over free pixels alone.

    Raises:
        TrackError: it does not.
    """
    places = course.line[~occupancy.is_free(course.line[:, :2]), :2]
    if len(places):
        x, y = places[0]
        raise TrackError(
            f"{occupancy.file.path}: the corridor is too narrow near ({x:.2f}, {y:.2f}) for a "
            "line of this scale; give a finer picture, or draw away what stands there"
        )


def _remark_on(points: Floats, width: float, corridor: Corridor | None) -> str:
    """Return a sentence on what may be wrong with a course, "" for nothing. width: the mean [m]."""
    if width > WIDEST:
        unit = "resolution: metres for each pixel" if corridor else "all columns are in metres"
        return f"it is {width:.0f} m wide on average: check the unit ({unit})"
    if corridor is None:
        *steps, last = lengths_of(points[:, :2]).tolist()
        if last <= OPEN * max(steps):
            return ""
        return (
            f"the last point is {last:.2f} m from the first, and others are {max(steps):.2f} m "
            "apart at most: the course closes across that gap, where it may not lead"
        )
    if corridor.is_at_frame:
        return (
            "the course reaches the edge of the picture, where no wall stands: leave a margin, "
            "draw its walls shut, or swap light and dark with negate, where they are the other "
            "way round"
        )
    if corridor.others:
        return (
            f"the map has {corridor.others + 1} corridors that are closed, apart from one another; "
            "the course is the one about the largest island: draw shut what is not part of it"
        )
    if not (count := other_loops(corridor)):
        return ""
    return (
        f"the map has {count + 1} islands that may each be the middle of a loop; the course leads "
        "around the largest, and past the others: draw shut what is not part of it"
    )


def _kept_map(occupancy: OccupancyMap, target: Path) -> dict[Path, bytes]:
    """Return the files of a map, to be kept beside a course: what is free, and where it lies.

    None where the map lies there already.

    Raises:
        TrackError: the picture of the map would be written over.
    """
    from PIL import Image

    path = target.with_suffix(MAP_BESIDE)
    if path.exists() and path.samefile(occupancy.file.path):
        return {}
    image, picture = path.with_suffix(".png"), BytesIO()
    if image.exists() and image.samefile(occupancy.file.image):
        raise TrackError(
            f"{image}: the picture of the map, which would be written over; write the course under "
            "another name"
        )
    Image.fromarray(np.where(occupancy.free[1:-1, 1:-1], 254, 0).astype(np.uint8)).save(
        picture, "PNG"
    )
    words = (
        f"image: {image.name}\nresolution: {occupancy.file.resolution!r}\n"
        f"origin: {list(occupancy.file.origin)}\nnegate: 0\n"
        "occupied_thresh: 0.65\nfree_thresh: 0.196\n"
    )
    return {image: picture.getvalue(), path: words.encode()}


def map_beside(course_file: Path) -> Path | None:
    """Return the map that is kept beside a course file, if there is one."""
    path = course_file.with_suffix(MAP_BESIDE)
    return path if path.is_file() else None
