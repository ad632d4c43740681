"""Occupancy maps of ROS map_server: a picture and a YAML file beside it."""

import math
import re
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_server.errors import TrackError
from race_server.scenario.text_files import read_text
from race_server.scenario.toml_reader import FARTHEST
from race_server.scenario.track.course import Floats
from race_server.scenario.track.pixel_parts import Mask

# Pictures that map_server writes, and that people convert them to.
FORMATS = ("PPM", "PNG", "BMP")
# What the picture says: shades from free to occupied in the first two, and the numbers of an
# occupancy grid in the last: 0 to MOST_RAW, above it unknown.
MODES, RAW, MOST_RAW = ("trinary", "scale", "raw"), "raw", 100
TRUE, FALSE = ("1", "true", "yes", "on"), ("0", "false", "no", "off")
MOST_YAML = 1 << 16  # bytes
LEAST_STEP, MOST_STEP = 1e-3, 10.0  # [m] of a pixel
MOST_PIXELS = 1 << 24
OPAQUE = 128  # of 255; a pixel through which more is seen is not free
RAY_STEP = 0.25  # pixels from one point of a ray to the next
# Gaps in a wall up to this wide [m] are closed, and those of two pixels: pictures that are drawn or
# scanned have such. No vehicle passes the first; a map whose pixels are coarser shows no passage of
# two.
GAP = 0.1


@dataclass(frozen=True)
class MapFile:
    """The content of the YAML file."""

    path: Path  # of it
    image: Path
    resolution: float  # [m] per pixel
    origin: tuple[float, float, float]  # pose of the lower left pixel
    negate: bool
    free_below: float  # occupancy under which a pixel is free
    mode: str = MODES[0]


@dataclass(frozen=True, eq=False)
class OccupancyMap:
    """Which pixels of a map are free; those beyond its edge are not.

    Points in pixels are column and row, counted from the upper left corner of `free`.
    """

    file: MapFile
    free: Mask  # (rows, columns) with a frame of one pixel that is not free around the picture

    def points_of(self, pixels: Floats) -> Floats:
        """Return points (N, 2) of the picture in the map's frame [m]."""
        step, (x0, y0, angle) = self.file.resolution, self.file.origin
        x, y = (pixels[:, 0] - 1.0) * step, (len(self.free) - 1.0 - pixels[:, 1]) * step
        cos, sin = math.cos(angle), math.sin(angle)
        return np.column_stack([x0 + cos * x - sin * y, y0 + sin * x + cos * y])

    def pixels_of(self, points: Floats) -> Floats:
        """Return points (N, 2) [m] of the map's frame in the picture."""
        step, (x0, y0, angle) = self.file.resolution, self.file.origin
        cos, sin = math.cos(angle), math.sin(angle)
        x, y = points[:, 0] - x0, points[:, 1] - y0
        right, up = cos * x + sin * y, cos * y - sin * x
        return np.column_stack([right / step + 1.0, len(self.free) - 1.0 - up / step])

    def is_free(self, points: Floats) -> NDArray[np.bool_]:
        """Return whether each point (N, 2) [m] lies on a free pixel."""
        return _at(self.free, self.pixels_of(points))

    def ranges_to_walls(self, points: Floats, ways: Floats, reach: float) -> Floats:
        """Return how far [m] it is to a wall from each point, at most `reach`.

        points: (N, 2) [m]; ways: (N, 2) directions of length one in the map's frame.
        """
        start = self.pixels_of(points)
        step = self.pixels_of(points + ways * RAY_STEP * self.file.resolution) - start
        most = math.ceil(reach / (RAY_STEP * self.file.resolution))
        # One step back from the first point in a wall is half a step too short on average.
        ranges, going = np.full(len(points), float(most)), np.arange(len(points))
        before = start
        for number in range(most + 1):
            here = start[going] + number * step[going]
            meets = ~_at(self.free, here)
            # Between two pixels of a wall that touch at a corner no ray passes.
            aside = [
                np.column_stack(pair)
                for pair in ((here[:, 0], before[:, 1]), (before[:, 0], here[:, 1]))
            ]
            meets |= ~(_at(self.free, aside[0]) | _at(self.free, aside[1]))
            ranges[going[meets]] = max(number - 0.5, 0.0)
            going, before = going[~meets], here[~meets]
        return np.asarray(np.minimum(ranges * RAY_STEP * self.file.resolution, reach))


def _at(free: Mask, pixels: Floats) -> NDArray[np.bool_]:
    rows, columns = free.shape
    column = np.clip(np.floor(pixels[:, 0]), 0, columns - 1).astype(np.int64)
    row = np.clip(np.floor(pixels[:, 1]), 0, rows - 1).astype(np.int64)
    return np.asarray(free[row, column])


def read_map_file(path: Path) -> MapFile:
    """Return the content of a map's YAML file.

    Raises:
        TrackError: it cannot be read, or a key is missing or wrong.
    """
    words = _values_in(read_text(path, MOST_YAML, TrackError))
    for key in ("image", "resolution", "origin"):
        if key not in words:
            raise TrackError(f"{path}: the key {key} is missing; write one `key: value` on a line")

    def wrong(key: str, way_out: str) -> TrackError:
        return TrackError(f"{path}: {key} = {words[key][:60]}: {way_out}")

    resolution = _numbers_in(words["resolution"])
    if len(resolution) != 1 or not LEAST_STEP <= resolution[0] <= MOST_STEP:
        raise wrong("resolution", f"give metres per pixel, {LEAST_STEP:g} to {MOST_STEP:g}")
    origin = _numbers_in(words["origin"].strip("[]"))
    if len(origin) != 3 or not np.isfinite(origin).all():
        raise wrong("origin", "give three finite numbers [x, y, angle]")
    if max(map(abs, origin[:2])) > FARTHEST:
        raise wrong("origin", f"stay within {FARTHEST:g} m of zero")
    if abs(origin[2]) > 2.0 * math.pi:
        raise wrong("origin", "the angle is in radians, up to one turn")
    negate = words.setdefault("negate", "0").lower()
    if negate not in TRUE + FALSE:
        raise wrong("negate", "give 0 or 1")
    free = _numbers_in(words.setdefault("free_thresh", "0.196"))
    if len(free) != 1 or not 0.0 < free[0] <= 1.0:
        raise wrong("free_thresh", "give a share above 0, up to 1")
    occupied = _numbers_in(words.setdefault("occupied_thresh", "1.0"))
    if len(occupied) != 1 or not free[0] <= occupied[0] <= 1.0:
        raise wrong("occupied_thresh", f"give a share from free_thresh ({free[0]:g}) to 1")
    if words.setdefault("mode", MODES[0]) not in MODES:
        raise wrong("mode", f"choose one of {', '.join(MODES)}")
    return MapFile(
        path=path,
        image=path.parent / words["image"],
        resolution=resolution[0],
        origin=(origin[0], origin[1], origin[2]),
        negate=negate in TRUE,
        free_below=free[0],
        mode=words["mode"],
    )


def _values_in(text: str) -> dict[str, str]:
    """Return the values of a map's YAML by their keys; of a list what stands between commas."""
    words: dict[str, str] = {}
    last = ""
    for line in text.splitlines():
        if words and words[last].startswith("[") and "]" not in words[last]:
            words[last] += " " + _value_in(line)
            continue
        if last and line.strip().startswith("- "):
            words[last] += ", " * bool(words[last]) + _value_in(line.strip()[1:])
            continue
        key, colon, value = line.partition(":")
        if colon and not key.lstrip().startswith("#"):
            last = key.strip()
            words[last] = _value_in(value)
    return words


def _value_in(text: str) -> str:
    """Return what is in quotes at the start of a text, or what stands before a comment."""
    text = text.strip()
    if text[:1] in {"'", '"'} and (end := text.find(text[0], 1)) > 0:
        return text[1:end]
    return re.split(r"(?:^|\s)#", text, maxsplit=1)[0].strip()


def _numbers_in(text: str) -> list[float]:
    """Return the numbers between commas; an empty list if there is anything else."""
    try:
        return [float(word) for word in text.split(",")]
    except ValueError:
        return []


def read_map(path: Path) -> OccupancyMap:
    """Return the map that a YAML file describes.

    Raises:
        TrackError: the file or its picture cannot be read.
    """
    map_file = read_map_file(path)
    grey, opaque = _grey(map_file.image)
    if map_file.mode == RAW:
        levels = np.arange(256.0)
        occupied = np.where(levels <= MOST_RAW, levels / MOST_RAW, np.inf)
    else:
        levels = np.arange(256) / 255.0
        occupied = levels if map_file.negate else 1.0 - levels
    walls = ~((occupied < map_file.free_below)[grey] & opaque)
    reach = max(math.ceil(0.5 * GAP / map_file.resolution - 1e-9), 1)
    free: Mask = ~np.pad(_closed(walls, reach), 1, constant_values=True)
    return OccupancyMap(map_file, free)


def _closed(walls: Mask, reach: int) -> Mask:
    """Return walls without gaps of up to twice `reach` pixels: wider by it, and then narrower."""
    wider = np.pad(walls, reach, mode="edge")
    for axis in (0, 1):
        wider = _widened(wider, reach, axis)
    for axis in (0, 1):
        wider = ~_widened(~wider, reach, axis)
    return wider[reach:-reach, reach:-reach]


def _widened(mask: Mask, reach: int, axis: int) -> Mask:
    """Return a mask that is wider by `reach` pixels along an axis."""
    length = mask.shape[axis]
    counts = np.cumsum(mask, axis=axis, dtype=np.int32)
    places = np.arange(length)
    last = counts.take(np.minimum(places + reach, length - 1), axis=axis)
    first = counts.take(np.maximum(places - reach - 1, 0), axis=axis)
    none = (places <= reach).reshape((-1, 1) if axis == 0 else (1, -1))
    return np.asarray(last > np.where(none, 0, first))


def _grey(path: Path) -> tuple[NDArray[np.uint8], Mask]:
    """Return the grey levels of a picture and what of it is opaque, shape (rows, columns) each."""
    from PIL import Image, UnidentifiedImageError

    try:
        # A picture of more pixels than are read is refused below, or by Pillow, before it is read.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            picture = Image.open(path, formats=FORMATS)
        with picture:
            is_larger = picture.width * picture.height > MOST_PIXELS
            if not is_larger:
                return _levels_of(picture)
    except Image.DecompressionBombError:
        is_larger = True
    except UnidentifiedImageError as error:
        raise TrackError(f"{path}: no picture that can be read; give a PGM, PNG or BMP") from error
    # Whatever damage makes the readers of pictures trip over.
    except Exception as error:
        raise TrackError(f"{path}: no picture that can be read: {str(error)[:200]}") from error
    raise TrackError(f"{path}: larger than {MOST_PIXELS} pixels; make it coarser")


def _levels_of(picture: Any) -> tuple[NDArray[np.uint8], Mask]:
    """Return the mean of the colours of a picture, as map_server takes it, and what is opaque."""
    if picture.mode.startswith("I"):  # 16 bits
        grey = (np.asarray(picture).astype(np.int64) + 128) // 257
    elif picture.mode in {"1", "L"} and "transparency" not in picture.info:
        grey = np.asarray(picture.convert("L"))
    else:
        colours = np.asarray(picture.convert("RGBA"))
        grey = (colours[..., :3].sum(axis=2, dtype=np.uint16) + 1) // 3
        return grey.astype(np.uint8), colours[..., 3] >= OPAQUE
    return grey.astype(np.uint8), np.ones(grey.shape, np.bool_)
