"""Exact ranges of a whole fan of rays: every wall in reach is laid over the rays it covers.

For many rays this is far cheaper than to walk each ray through the grid: a wall costs one look,
and its rays follow from two divisions and a comparison each. Walls are stored with the drivable
side on their left, so that a sensor on their right cannot see them; from where a kart can be, the
first wall that a ray meets always shows its left side.
"""

import math
from typing import NamedTuple

from race_server.core.kernels.boxes import Hull
from race_server.core.kernels.geometry import ROUGHNESS, TURN, cos_sin, rough_angle
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.rays import Fan
from race_server.core.state import Float32s, Record, Walls

# With fewer rays than this the grid is cheaper.
FEW_RAYS = 24


class Wall(NamedTuple):
    """A wall from a to b in the frame of the sensor, which sees it from its left."""

    ax: float  # [m]
    ay: float
    bx: float
    by: float
    area: float  # twice that of the triangle with the sensor [m²]


@kernel
def scan_walls(walls: Walls, site: Record, fan: Fan, ranges: Float32s) -> None:
    """Fill the ranges of a fan of rays to the walls, at most its reach.

    site: SITE; ranges: (R,) [m].
    """
    for ray in range(len(fan.rays)):
        ranges[ray] = fan.reach
    step = fan.field / (len(fan.rays) - 1)
    segments = walls.segments
    # Where the wall before ended: walls follow one another along a border, so that this is
    # mostly where the next one begins.
    last_x, last_y, last = math.inf, math.inf, 0.0
    for group in range(site.group_start, site.group_start + site.group_count):
        circle = walls.groups[group]
        dx, dy = circle.x - fan.x, circle.y - fan.y
        near = fan.reach + circle.radius
        if dx * dx + dy * dy > near * near:
            continue
        for number in range(circle.first, circle.last):
            x0, y0 = segments[number, 0] - fan.x, segments[number, 1] - fan.y
            x1, y1 = segments[number, 2] - fan.x, segments[number, 3] - fan.y
            area = x0 * y1 - y0 * x1
            if area <= 0.0:
                continue  # seen from behind, or edge-on
            # Both ends in the frame of the sensor; seen from it the wall runs counter-clockwise.
            ax, ay = x0 * fan.cos + y0 * fan.sin, y0 * fan.cos - x0 * fan.sin
            bx, by = x1 * fan.cos + y1 * fan.sin, y1 * fan.cos - x1 * fan.sin
            begin = last
            if ax != last_x or ay != last_y:
                begin = rough_angle(ax, ay)
            last_x, last_y, last = bx, by, rough_angle(bx, by)
            _lay_wall(Wall(ax, ay, bx, by, area), begin, last, fan, step, ranges)


@kernel
def scan_body(fan: Fan, body: Hull, ranges: Float32s) -> None:
    """Shorten the rays of a fan that meet the body of a kart, as `scan_walls` does for walls.

    ranges: (R,) [m], already filled.
    """
    dx, dy = body.x - fan.x, body.y - fan.y
    half_length, half_width = body.half_length, body.half_width
    near = fan.reach + abs(body.offset) + half_length + half_width
    if dx * dx + dy * dy > near * near:
        return
    box_cos, box_sin = cos_sin(body.heading)
    # Middle and half axes of the box in the frame of the sensor.
    dx, dy = dx + body.offset * box_cos, dy + body.offset * box_sin
    mx, my = dx * fan.cos + dy * fan.sin, dy * fan.cos - dx * fan.sin
    c, s = box_cos * fan.cos + box_sin * fan.sin, box_sin * fan.cos - box_cos * fan.sin
    ux, uy, vx, vy = half_length * c, half_length * s, -half_width * s, half_width * c
    if abs(mx * c + my * s) <= half_length and abs(my * c - mx * s) <= half_width:
        for ray in range(len(fan.rays)):  # from inside
            ranges[ray] = 0.0
        return
    step = fan.field / (len(fan.rays) - 1)
    ax, ay = mx + ux + vx, my + uy + vy
    for side in range(4):
        # Clockwise around the box, so that its outside lies on the left of each side.
        along = 1.0 if side == 0 or side == 3 else -1.0
        across = -1.0 if side <= 1 else 1.0
        bx, by = mx + along * ux + across * vx, my + along * uy + across * vy
        area = ax * by - ay * bx
        if area > 0.0:
            begin, end = rough_angle(ax, ay), rough_angle(bx, by)
            _lay_wall(Wall(ax, ay, bx, by, area), begin, end, fan, step, ranges)
        ax, ay = bx, by


@kernel
def _lay_wall(
    wall: Wall, begin: float, end: float, fan: Fan, step: float, ranges: Float32s
) -> None:
    """Lay a wall over the rays of a fan.

    begin, end: rough directions of a and b [rad]; step: angle between two rays [rad]; ranges: (R,)
    [m], already filled.
    """
    if end < begin - 2.0 * ROUGHNESS:
        # Across the back of the sensor: the far end counts on, or the near end lies a turn back.
        _lay_over(wall, begin - TURN, end, fan, step, ranges)
        end += TURN
    _lay_over(wall, begin, end, fan, step, ranges)


@kernel
def _lay_over(
    wall: Wall, begin: float, end: float, fan: Fan, step: float, ranges: Float32s
) -> None:
    """Shorten the rays between two rough directions that meet a wall.

    begin, end: the directions [rad]; step: angle between two rays [rad]; ranges: (R,) [m], already
    filled.
    """
    rays = fan.rays
    half = 0.5 * fan.field
    first = max(math.floor((begin - ROUGHNESS + half) / step), 0)
    last = min(math.ceil((end + ROUGHNESS + half) / step), len(rays) - 1)
    # The directions are rough; which rays pass between the ends is decided exactly.
    while first <= last and rays[first, 0] * wall.ay - rays[first, 1] * wall.ax > 0.0:
        first += 1
    while first <= last and rays[last, 0] * wall.by - rays[last, 1] * wall.bx < 0.0:
        last -= 1
    ex, ey = wall.bx - wall.ax, wall.by - wall.ay
    for ray in range(first, last + 1):
        across = rays[ray, 0] * ey - rays[ray, 1] * ex
        if wall.area < ranges[ray] * across:
            ranges[ray] = wall.area / across
