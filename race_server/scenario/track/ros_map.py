"""Courses from occupancy maps of ROS map_server: a picture and a YAML file beside it.

White is free. The course is the corridor around the largest island of walls: its outer and inner
outlines are followed in the picture, and the line midway between them becomes the centre line.
"""

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
from race_server.scenario.track.medial import medial_line
from race_server.scenario.track.polyline import (
    area_of,
    lengths_of,
    nearest_on,
    resample,
    segments_of,
    smooth,
)

Mask = NDArray[np.bool_]
Numbers = NDArray[np.signedinteger[Any]]
# Pictures that map_server writes, and that people convert them to.
FORMATS = ("PPM", "PNG", "BMP")
MOST_YAML = 1 << 16  # bytes
MOST_PIXELS = 1 << 24
MOST_RUNS = 1 << 20  # of pixels in a row
MOST_OUTLINE = 1 << 14  # edges of pixels


@dataclass(frozen=True)
class MapFile:
    """The content of the YAML file."""

    image: Path
    resolution: float  # [m] per pixel
    origin: tuple[float, float, float]  # pose of the lower left pixel
    negate: bool
    free_below: float  # occupancy under which a pixel is free


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
    return map_file


def read_ros_map(path: Path) -> Floats:
    """Return points of a centre line with half-widths, shape (N, 4): x, y, left, right [m].

    path: of the YAML file.

    Raises:
        TrackError: no map, or no closed corridor in it.
    """
    map_file = read_map_file(path)
    free = _largest(_free_pixels(map_file), path)
    parts, sizes = _components(~free, path)
    outside = parts == parts[0, 0]
    sizes[parts[0, 0]] = 0
    if not sizes.any():
        raise TrackError(f"{path}: the free space has no island in it: no closed corridor")
    outer = _outline(~outside, path)
    inner = _outline(parts == np.argmax(sizes), path)
    step = map_file.resolution
    outer, inner = (
        _to_world(smooth(line, 2.0), free.shape[0], map_file) for line in (outer, inner)
    )
    line, _ = medial_line(outer, inner, 2.0 * step)
    if area_of(line) < 0.0:
        line = line[::-1]
    line = smooth(line, 5.0)
    length = float(lengths_of(line).sum())
    line = resample(line, max(round(length / max(10.0 * step, length / 400.0)), 24))
    left = nearest_on(segments_of(inner), line)[0]
    right = nearest_on(segments_of(outer), line)[0]
    return np.column_stack([line, left, right])


def _free_pixels(map_file: MapFile) -> Mask:
    from PIL import Image

    path = map_file.image
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
    levels = np.arange(256) / 255.0
    occupied = levels if map_file.negate else 1.0 - levels
    free: Mask = np.pad((occupied < map_file.free_below)[grey], 1)
    return free


def _largest(mask: Mask, path: Path) -> Mask:
    parts, sizes = _components(mask, path)
    if not len(sizes):
        raise TrackError(f"{path}: the map has no free pixel")
    return np.asarray(parts == np.argmax(sizes))


def _components(mask: Mask, path: Path) -> tuple[Numbers, Numbers]:
    """Return the part of each pixel, and the pixels of each part; four neighbours are connected.

    Pixels outside the mask are of part -1. Parts are found by runs of pixels in a row: runs in
    neighbouring rows that touch get the smaller number of the two, until nothing changes.
    """
    height, width = mask.shape
    # A column that is in no part stands between the end of a row and the next row.
    flat = np.zeros((height, width + 1), np.int8)
    flat[:, :-1] = mask
    steps = np.diff(flat.ravel(), prepend=0)
    starts, ends = np.flatnonzero(steps == 1), np.flatnonzero(steps == -1)
    if len(starts) > MOST_RUNS:
        raise TrackError(f"{path}: {len(starts)} runs of pixels; at most {MOST_RUNS} make a map")
    first = np.searchsorted(ends, starts + width + 1, side="right")
    beyond = np.searchsorted(starts, ends + width + 1, side="left")
    counts = np.maximum(beyond - first, 0)
    above = np.repeat(np.arange(len(starts)), counts)
    below = np.arange(len(above)) - np.repeat(np.cumsum(counts) - counts, counts) + first[above]
    roots = _joined(len(starts), above, below)
    parts = np.full(mask.shape, -1, np.int32)
    parts[mask] = np.repeat(roots.astype(np.int32), ends - starts)
    return parts, np.bincount(roots, ends - starts).astype(np.int64)


def _joined(count: int, above: Numbers, below: Numbers) -> Numbers:
    """Return the smallest number that each of `count` things is joined with, shape (count,)."""
    roots = np.arange(count)
    while True:
        one, other = roots[above], roots[below]
        if np.array_equal(one, other):
            return roots
        np.minimum.at(roots, np.maximum(one, other), np.minimum(one, other))
        while not np.array_equal(roots, roots[roots]):
            roots = roots[roots]


def _outline(mask: Mask, path: Path) -> Floats:
    """Return the outline of a filled shape in pixels, shape (N, 2): column, row of its corners.

    Walks along the edges between pixels with the shape on the right hand.
    """
    padded = np.pad(mask, 1)
    row, column = (int(n) for n in np.argwhere(padded)[0])
    start = (row, column)
    place, way = start, (0, 1)  # along the top edge of the first pixel
    points: list[tuple[float, float]] = []
    while True:
        if len(points) == MOST_OUTLINE:
            raise TrackError(
                f"{path}: an outline has more than {MOST_OUTLINE} edges of pixels; make the "
                "picture coarser"
            )
        points.append((place[1] - 1.0, place[0] - 1.0))
        place = (place[0] + way[0], place[1] + way[1])
        way = _next_way(padded, place, way)
        if place == start and way == (0, 1):
            return np.array(points)


def _next_way(mask: Mask, place: tuple[int, int], way: tuple[int, int]) -> tuple[int, int]:
    row, column = place
    dr, dc = way
    # Pixels ahead on the right and on the left of the edge that continues.
    right = mask[row + (dr - 1) // 2 + (dc == 1), column + (dc - 1) // 2 + (dr == -1)]
    left = mask[row + (dr - 1) // 2 + (dc == -1), column + (dc - 1) // 2 + (dr == 1)]
    if left:
        return (-dc, dr)
    return way if right else (dc, -dr)


def _to_world(pixels: Floats, height: int, map_file: MapFile) -> Floats:
    """Return points of the padded picture in the map's frame [m]."""
    x = (pixels[:, 0] - 1.0) * map_file.resolution
    y = (height - 1.0 - pixels[:, 1]) * map_file.resolution
    angle = map_file.origin[2]
    cos, sin = math.cos(angle), math.sin(angle)
    return np.column_stack(
        [map_file.origin[0] + cos * x - sin * y, map_file.origin[1] + sin * x + cos * y]
    )
