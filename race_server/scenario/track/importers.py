"""Convert courses of other formats into track files."""

from pathlib import Path

from race_server.errors import TrackError
from race_server.scenario.track.build import SCALES
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.load import read_course
from race_server.scenario.track.ros_map import read_ros_map
from race_server.scenario.track.tum import read_tum

READERS = {".csv": read_tum, ".yaml": read_ros_map, ".yml": read_ros_map}


def import_course(source: Path, target: Path, *, scale: str, title: str) -> Course:
    """Write the course of a TUM CSV or of a ROS map's YAML as a track file, and return it.

    Raises:
        TrackError: the source is neither, or holds no course; no file is written then.
    """
    reader = READERS.get(source.suffix.lower())
    if reader is None:
        raise TrackError(f"{source}: import a TUM .csv or the .yaml of a ROS map")
    if scale not in SCALES:
        raise TrackError(f"scale {scale!r} is unknown; choose one of {', '.join(SCALES)}")
    points = reader(source)
    try:
        target.write_text(_file_of(points, source.name, scale, title))
    except OSError as error:
        raise TrackError(f"{target}: cannot be written: {error.strerror}") from error
    try:
        return read_course(target)
    except TrackError:
        target.unlink()
        raise


def _file_of(points: Floats, source: str, scale: str, title: str) -> str:
    clean = "".join(letter for letter in title if letter.isprintable() and letter not in '"\\')
    rows = [f"    [{x:.4f}, {y:.4f}, {left:.4f}, {right:.4f}]," for x, y, left, right in points]
    head = [
        f"# Imported from {source}. Points: x, y, half-width left, half-width right [m].",
        "",
        f'title = "{clean[:64] or "Imported"}"',
        'form = "line"',
        f'scale = "{scale}"',
        "points = [",
    ]
    return "\n".join([*head, *rows, "]", ""])
