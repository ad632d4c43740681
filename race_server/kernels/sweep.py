"""Exact ranges of a whole fan of rays: every wall in reach is laid over the rays it covers.

For many rays this is far cheaper than to walk each ray through the grid: a wall costs one look,
and its rays follow from two divisions and a comparison each. Walls are stored with the drivable
side on their left, so that a sensor on their right cannot see them; from where a kart can be, the
first wall that a ray meets always shows its left side.
"""

import math

from race_server.kernels.geometry import ROUGHNESS, TURN, rough_angle
from race_server.kernels.jit import kernel
from race_server.state import Atlas, Float32s, Floats, Record

# With fewer rays than this the grid is cheaper.
FEW_RAYS = 24


@kernel
def sweep_walls(
    atlas: Atlas,
    course: Record,
    x: float,
    y: float,
    cos: float,
    sin: float,
    rays: Floats,
    field: float,
    reach: float,
    ranges: Float32s,
) -> None:
    """Fill the ranges [m] of a fan of rays to the walls, at most `reach`.

    (x, y) and (cos, sin): place and direction of the sensor; rays: (R, 2) cosine and sine of
    evenly spaced rays in its frame; field: angle between the outermost rays [rad].
    """
    for ray in range(len(rays)):
        ranges[ray] = reach
    step = field / (len(rays) - 1)
    for group in range(course.group_start, course.group_start + course.group_count):
        circle = atlas.groups[group]
        dx, dy = circle.x - x, circle.y - y
        near = reach + circle.radius
        if dx * dx + dy * dy <= near * near:
            for wall in range(circle.first, circle.last):
                _lay_wall(atlas.walls, wall, x, y, cos, sin, rays, field, step, ranges)


@kernel
def _lay_wall(
    walls: Floats,
    wall: int,
    x: float,
    y: float,
    cos: float,
    sin: float,
    rays: Floats,
    field: float,
    step: float,
    ranges: Float32s,
) -> None:
    x0, y0 = walls[wall, 0] - x, walls[wall, 1] - y
    x1, y1 = walls[wall, 2] - x, walls[wall, 3] - y
    area = x0 * y1 - y0 * x1
    if area <= 0.0:
        return  # seen from behind, or edge-on
    # Both ends in the frame of the sensor; seen from it the wall runs counter-clockwise.
    ax, ay = x0 * cos + y0 * sin, y0 * cos - x0 * sin
    bx, by = x1 * cos + y1 * sin, y1 * cos - x1 * sin
    begin, end = rough_angle(ax, ay), rough_angle(bx, by)
    if end < begin - 2.0 * ROUGHNESS:
        # Across the back of the sensor: the far end counts on, or the near end lies a turn back.
        _lay_over(ax, ay, bx, by, area, begin - TURN, end, rays, field, step, ranges)
        end += TURN
    _lay_over(ax, ay, bx, by, area, begin, end, rays, field, step, ranges)


@kernel
def _lay_over(
    ax: float,
    ay: float,
    bx: float,
    by: float,
    area: float,
    begin: float,
    end: float,
    rays: Floats,
    field: float,
    step: float,
    ranges: Float32s,
) -> None:
    """Shorten the rays between two rough directions that meet the wall from a to b."""
    half = 0.5 * field
    first = max(math.floor((begin - ROUGHNESS + half) / step), 0)
    last = min(math.ceil((end + ROUGHNESS + half) / step), len(rays) - 1)
    # The directions are rough; which rays pass between the ends is decided exactly.
    while first <= last and rays[first, 0] * ay - rays[first, 1] * ax > 0.0:
        first += 1
    while first <= last and rays[last, 0] * by - rays[last, 1] * bx < 0.0:
        last -= 1
    ex, ey = bx - ax, by - ay
    for ray in range(first, last + 1):
        across = rays[ray, 0] * ey - rays[ray, 1] * ex
        if area < ranges[ray] * across:
            ranges[ray] = area / across
