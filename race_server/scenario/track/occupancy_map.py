"""Occupancy maps of ROS map_server: a picture and a YAML file beside it."""

import math
import warnings
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_server.errors import TrackError
from race_server.scenario.text_files import read_text
from race_server.scenario.track.course import Floats
from race_server.scenario.track.pixel_parts import Mask

# Pictures that map_server writes, and that people convert them to.
FORMATS = ("PPM", "PNG", "BMP")
MOST_YAML = 1 << 16  # bytes
MOST_PIXELS = 1 << 24
RAY_STEP = 0.25  # pixels from one point of a ray to the next


@dataclass(frozen=True)
class MapFile:
    """The content of the YAML file."""

    path: Path  # of it
    image: Path
    resolution: float  # [m] per pixel
    origin: tuple[float, float, float]  # pose of the lower left pixel
    negate: bool
    free_below: float  # occupancy under which a pixel is free


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
        for number in range(most + 1):
            meets = ~_at(self.free, start[going] + number * step[going])
            ranges[going[meets]] = max(number - 0.5, 0.0)
            going = going[~meets]
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
    words = {}
    for line in read_text(path, MOST_YAML, TrackError).splitlines():
        key, colon, value = line.split("#", 1)[0].partition(":")
        if colon:
            words[key.strip()] = value.strip().strip("'\"")
    try:
        origin = [float(word) for word in words["origin"].strip("[]").split(",")]
        map_file = MapFile(
            path=path,
            image=path.parent / words["image"],
            resolution=float(words["resolution"]),
            origin=(origin[0], origin[1], origin[2]),
            negate=words.get("negate", "0") not in {"0", "false", "False"},
            free_below=float(words.get("free_thresh", "0.196")),
        )
    except KeyError as error:
        raise TrackError(f"{path}: the key {error.args[0]} is missing") from error
    except (ValueError, IndexError) as error:
        raise TrackError(f"{path}: {error}") from error
    if not 0.0 < map_file.resolution <= 10.0:
        raise TrackError(
            f"{path}: resolution = {map_file.resolution}: give metres per pixel, up to 10"
        )
    if not np.isfinite(origin[:3]).all():
        raise TrackError(f"{path}: origin = {words['origin']}: give finite numbers")
    return map_file


def read_map(path: Path) -> OccupancyMap:
    """Return the map that a YAML file describes.

    Raises:
        TrackError: the file or its picture cannot be read.
    """
    map_file = read_map_file(path)
    levels = np.arange(256) / 255.0
    occupied = levels if map_file.negate else 1.0 - levels
    free: Mask = np.pad((occupied < map_file.free_below)[_grey(map_file.image)], 1)
    return OccupancyMap(map_file, free)


def _grey(path: Path) -> NDArray[Any]:
    """Return the grey levels of a picture, shape (rows, columns), 0 to 255."""
    from PIL import Image

    try:
        # A picture of more pixels than are read is refused below, or by Pillow, before it is read.
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            picture = Image.open(path, formats=FORMATS)
        with picture:
            is_larger = picture.width * picture.height > MOST_PIXELS
            grey = np.zeros(0) if is_larger else np.asarray(picture.convert("L"))
    except Image.DecompressionBombError:
        is_larger = True
    # Whatever damage makes the readers of pictures trip over.
    except Exception as error:
        raise TrackError(f"{path}: no picture that can be read: {str(error)[:200]}") from error
    if is_larger:
        raise TrackError(f"{path}: larger than {MOST_PIXELS} pixels")
    return grey
