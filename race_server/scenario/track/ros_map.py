"""Courses from occupancy maps of ROS map_server: a picture and a YAML file beside it.

White is free. The course is the corridor around the largest island of walls: its outer and inner
outlines are followed in the picture, and the line midway between them becomes the centre line.
"""

import math
from collections import deque
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from race_server.errors import TrackError
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
MOST_PIXELS = 64_000_000


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
    try:
        lines = path.read_text().splitlines()
    except (OSError, UnicodeDecodeError) as error:
        raise TrackError(f"{path}: cannot be read: {error}") from error
    words = {}
    for line in lines:
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
    free = _largest(_free_pixels(map_file))
    islands = _components(~free)
    outside, holes = islands[0], islands[1:]
    if not holes:
        raise TrackError(f"{path}: the free space has no island in it: no closed corridor")
    outer = _outline(~outside)
    inner = _outline(max(holes, key=lambda hole: int(hole.sum())))
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
    from PIL import Image, UnidentifiedImageError

    try:
        with Image.open(map_file.image) as picture:
            if picture.width * picture.height > MOST_PIXELS:
                raise TrackError(f"{map_file.image}: larger than {MOST_PIXELS} pixels")
            grey = np.asarray(picture.convert("L"), dtype=np.float64) / 255.0
    except (OSError, UnidentifiedImageError, ValueError) as error:
        raise TrackError(f"{map_file.image}: no picture that can be read: {error}") from error
    occupied = grey if map_file.negate else 1.0 - grey
    free: Mask = np.pad(occupied < map_file.free_below, 1)
    return free


def _largest(mask: Mask) -> Mask:
    parts = _components(mask, with_edge_first=False)
    if not parts:
        raise TrackError("the map has no free pixel")
    return max(parts, key=lambda part: int(part.sum()))


def _components(mask: Mask, *, with_edge_first: bool = True) -> list[Mask]:
    """Return the connected parts of a mask (four neighbours); the one at the corner first."""
    labels = np.zeros(mask.shape, np.int32)
    count = 0
    height, width = mask.shape
    seeds = np.argwhere(mask)
    for row, column in [(0, 0), *seeds.tolist()] if with_edge_first else seeds.tolist():
        if not mask[row, column] or labels[row, column]:
            continue
        count += 1
        labels[row, column] = count
        queue = deque([(row, column)])
        while queue:
            r, c = queue.popleft()
            for y, x in ((r + 1, c), (r - 1, c), (r, c + 1), (r, c - 1)):
                inside = 0 <= y < height and 0 <= x < width
                if inside and mask[y, x] and not labels[y, x]:
                    labels[y, x] = count
                    queue.append((y, x))
    return [labels == number for number in range(1, count + 1)]


def _outline(mask: Mask) -> Floats:
    """Return the outline of a filled shape in pixels, shape (N, 2): column, row of its corners.

    Walks along the edges between pixels with the shape on the right hand.
    """
    padded = np.pad(mask, 1)
    row, column = (int(n) for n in np.argwhere(padded)[0])
    start = (row, column)
    place, way = start, (0, 1)  # along the top edge of the first pixel
    points = []
    while True:
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
