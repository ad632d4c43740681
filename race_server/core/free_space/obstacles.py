"""Where a vehicle can stand and drive among walls and boxes.

Most poses are decided by a grid that knows how far each cell is from the nearest obstacle: discs
that cover the box are all free, or one inside of it is not. The others are decided exactly,
by the contacts of the world.

Between two poses of an arc a corner of a wall may pass through what is swept by a corner of the
vehicle, and be inside of neither box. So the way of each wall's ends is followed, seen from the
vehicle: a short arc around the middle of its turn, nearly a segment.
"""

import math
from typing import NamedTuple

from race_server.core.free_space.footprint import Footprint, box_at
from race_server.core.kernels.boxes import Box
from race_server.core.kernels.contacts import box_on_box, box_on_segment
from race_server.core.kernels.distance_field import (
    Grid,
    cell_at,
    clear_of_box,
    clear_of_walls,
)
from race_server.core.kernels.geometry import Pose, along_arc
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.state import Floats

# From the middle of a cell to its corner, in cells.
CORNER = math.sqrt(0.5)
# Discs that together cover the box.
DISCS = 3
# Poses on an arc are looked at so far apart [m]. Between two of them a corner of a car is off the
# segment between its places by 3 mm at most, far less than the margin of a footprint.
STRIDE = 0.2
# Of an obstacle farther away than this [m] from a box no corner passes between two poses.
PASSING = 0.15
# How closely a way ends at what is in it [m].
NEARNESS = 0.01
# No corner of a wall moves farther [m] between two poses, seen from the vehicle.
STEP_OF_CORNER = 0.6
BLOCKED, UNSURE, FREE = range(3)


class Obstacles(NamedTuple):
    """What must not be touched."""

    grid: Grid
    clear: Floats  # (rows, columns) [m] from the middle of each cell to an obstacle, up to a limit
    walls: Floats  # (P, 4) x0, y0, x1, y1 [m]
    boxes: Floats  # (B, 6) x, y [m], cosine and sine of the heading, half length, half width [m]


@kernel
def obstacle_box(obstacles: Obstacles, number: int) -> Box:
    """Return one of the boxes."""
    x, y, cos, sin, half_length, half_width = obstacles.boxes[number]
    return Box(x, y, cos, sin, half_length, half_width, number)


@large_kernel
def survey(obstacles: Obstacles, most: float) -> None:
    """Fill the clearances of the grid, up to `most` [m]."""
    clear = obstacles.clear
    for row in range(clear.shape[0]):
        for column in range(clear.shape[1]):
            clear[row, column] = most
    clear_of_walls(obstacles.grid, clear, obstacles.walls, most)
    for number in range(len(obstacles.boxes)):
        clear_of_box(obstacles.grid, clear, obstacle_box(obstacles, number), most)


@kernel
def cover_radius(footprint: Footprint) -> float:
    """Return the radius [m] of each of the discs that cover the box."""
    part = footprint.half_length / DISCS
    return math.sqrt(part * part + footprint.half_width * footprint.half_width)


@large_kernel
def touches(obstacles: Obstacles, box: Box) -> bool:
    """Return whether a box touches anything."""
    walls = obstacles.walls
    for wall in range(len(walls)):
        x0, y0, x1, y1 = walls[wall, 0], walls[wall, 1], walls[wall, 2], walls[wall, 3]
        if box_on_segment(box, x0, y0, x1, y1)[0] > 0.0:
            return True
    for number in range(len(obstacles.boxes)):
        if box_on_box(box, obstacle_box(obstacles, number))[0] > 0.0:
            return True
    return False


@kernel
def _verdict(obstacles: Obstacles, footprint: Footprint, box: Box) -> int:
    """Return what the grid knows: FREE with nothing near, BLOCKED or UNSURE."""
    grid = obstacles.grid
    right, above = box.x - grid.x0, box.y - grid.y0
    if not (0.0 <= right < grid.columns * grid.cell and 0.0 <= above < grid.rows * grid.cell):
        return BLOCKED
    corner = CORNER * grid.cell
    radius, verdict = cover_radius(footprint) + corner + PASSING, FREE
    for disc in range(DISCS):
        ahead = footprint.half_length * (2.0 * disc + 1.0 - DISCS) / DISCS
        row, column = cell_at(grid, box.x + ahead * box.cos, box.y + ahead * box.sin)
        clear = obstacles.clear[row, column]
        if clear < min(footprint.half_width, footprint.half_length - abs(ahead)) - corner:
            return BLOCKED
        if clear < radius:
            verdict = UNSURE
    return verdict


@large_kernel
def is_free(obstacles: Obstacles, footprint: Footprint, pose: Pose) -> bool:
    """Return whether a vehicle whose rear axle has a pose touches nothing, and is on the grid."""
    box = box_at(footprint, pose)
    verdict = _verdict(obstacles, footprint, box)
    return verdict == FREE or (verdict == UNSURE and not touches(obstacles, box))


@kernel
def _passes(footprint: Footprint, before: Box, after: Box, x: float, y: float) -> bool:
    """Return whether a point [m] passes through the box while that moves from a place to another.

    Seen from the box, the point moves.
    """
    dx, dy = x - after.x, y - after.y
    x1, y1 = dx * after.cos + dy * after.sin, dy * after.cos - dx * after.sin
    if abs(x1) > after.half_length + STEP_OF_CORNER or abs(y1) > after.half_width + STEP_OF_CORNER:
        return False
    dx, dy = x - before.x, y - before.y
    x0, y0 = dx * before.cos + dy * before.sin, dy * before.cos - dx * before.sin
    box = Box(0.0, 0.0, 1.0, 0.0, footprint.half_length, footprint.half_width, 0)
    return box_on_segment(box, x0, y0, x1, y1)[0] > 0.0


@large_kernel
def _corner_passes(obstacles: Obstacles, footprint: Footprint, before: Box, after: Box) -> bool:
    """Return whether an end of a wall, or a corner of a box, passes through the vehicle."""
    walls = obstacles.walls
    for wall in range(len(walls)):
        for end in range(0, 4, 2):
            if _passes(footprint, before, after, walls[wall, end], walls[wall, end + 1]):
                return True
    for number in range(len(obstacles.boxes)):
        box = obstacle_box(obstacles, number)
        for corner in range(4):
            ahead = box.half_length if corner & 1 else -box.half_length
            aside = box.half_width if corner & 2 else -box.half_width
            x = box.x + ahead * box.cos - aside * box.sin
            y = box.y + ahead * box.sin + aside * box.cos
            if _passes(footprint, before, after, x, y):
                return True
    return False


@large_kernel
def gets_there(obstacles: Obstacles, footprint: Footprint, start: Pose, end: Pose) -> bool:
    """Return whether the vehicle is free at the end of a short arc, and on it; the start is."""
    box = box_at(footprint, end)
    verdict = _verdict(obstacles, footprint, box)
    if verdict != UNSURE:
        return verdict == FREE
    if touches(obstacles, box):
        return False
    # Straight on, every corner stays beside or behind one of the boxes.
    if start.heading == end.heading:
        return True
    return not _corner_passes(obstacles, footprint, box_at(footprint, start), box)


@large_kernel
def free_way(
    obstacles: Obstacles, footprint: Footprint, pose: Pose, curvature: float, way: float
) -> float:
    """Return how far [m] the vehicle gets on an arc of `way` [m], negative in reverse.

    Where something is in the way, it gets there to within `NEARNESS`.
    """
    strides = math.ceil(abs(way) / STRIDE - 1e-9)
    last = pose
    for stride in range(1, strides + 1):
        driven = way if stride == strides else math.copysign(stride * STRIDE, way)
        following = along_arc(pose, curvature, driven)
        if gets_there(obstacles, footprint, last, following):
            last = following
            continue
        free = math.copysign((stride - 1) * STRIDE, way)
        while abs(driven - free) > NEARNESS:
            middle = 0.5 * (free + driven)
            if gets_there(obstacles, footprint, last, along_arc(pose, curvature, middle)):
                free = middle
            else:
                driven = middle
        return free
    return way
