"""Exact ranges of a whole fan of rays: every wall in reach is laid over the rays it covers.

For many rays this is far cheaper than to walk each ray through the grid: a wall costs one look,
and its rays follow from two divisions and a comparison each. Walls are stored with the drivable
side on their left, so that a sensor on their right cannot see them; from where a kart can be, the
first wall that a ray meets always shows its left side.
"""

import math

from race_server.core.kernels.geometry import ROUGHNESS, TURN, cos_sin, rough_angle
from race_server.core.kernels.jit import kernel
from race_server.core.state import Float32s, Floats, Record, Walls

# With fewer rays than this the grid is cheaper.
FEW_RAYS = 24


@kernel
def scan_walls(
    walls: Walls,
    site: Record,
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
    segments = walls.segments
    # Where the wall before ended: walls follow one another along a border, so that this is
    # mostly where the next one begins.
    last_x, last_y, last = math.inf, math.inf, 0.0
    for group in range(site.group_start, site.group_start + site.group_count):
        circle = walls.groups[group]
        dx, dy = circle.x - x, circle.y - y
        near = reach + circle.radius
        if dx * dx + dy * dy > near * near:
            continue
        for wall in range(circle.first, circle.last):
            x0, y0 = segments[wall, 0] - x, segments[wall, 1] - y
            x1, y1 = segments[wall, 2] - x, segments[wall, 3] - y
            area = x0 * y1 - y0 * x1
            if area <= 0.0:
                continue  # seen from behind, or edge-on
            # Both ends in the frame of the sensor; seen from it the wall runs counter-clockwise.
            ax, ay = x0 * cos + y0 * sin, y0 * cos - x0 * sin
            bx, by = x1 * cos + y1 * sin, y1 * cos - x1 * sin
            begin = last
            if ax != last_x or ay != last_y:
                begin = rough_angle(ax, ay)
            last_x, last_y, last = bx, by, rough_angle(bx, by)
            _lay_wall(ax, ay, bx, by, area, begin, last, rays, field, step, ranges)


@kernel
def scan_body(
    x: float,
    y: float,
    cos: float,
    sin: float,
    rays: Floats,
    field: float,
    reach: float,
    body_x: float,
    body_y: float,
    heading: float,
    offset: float,
    half_length: float,
    half_width: float,
    ranges: Float32s,
) -> None:
    """Shorten the rays of a fan that meet the body of a kart, as `scan_walls` does for walls.

    The body is an oriented box, `offset` [m] ahead of (body_x, body_y) along `heading` [rad].
    """
    dx, dy = body_x - x, body_y - y
    near = reach + abs(offset) + half_length + half_width
    if dx * dx + dy * dy > near * near:
        return
    box_cos, box_sin = cos_sin(heading)
    # Middle and half axes of the box in the frame of the sensor.
    dx, dy = dx + offset * box_cos, dy + offset * box_sin
    mx, my = dx * cos + dy * sin, dy * cos - dx * sin
    c, s = box_cos * cos + box_sin * sin, box_sin * cos - box_cos * sin
    ux, uy, vx, vy = half_length * c, half_length * s, -half_width * s, half_width * c
    if abs(mx * c + my * s) <= half_length and abs(my * c - mx * s) <= half_width:
        for ray in range(len(rays)):  # from inside
            ranges[ray] = 0.0
        return
    step = field / (len(rays) - 1)
    ax, ay = mx + ux + vx, my + uy + vy
    for side in range(4):
        # Clockwise around the box, so that its outside lies on the left of each side.
        along = 1.0 if side == 0 or side == 3 else -1.0
        across = -1.0 if side <= 1 else 1.0
        bx, by = mx + along * ux + across * vx, my + along * uy + across * vy
        area = ax * by - ay * bx
        if area > 0.0:
            begin, end = rough_angle(ax, ay), rough_angle(bx, by)
            _lay_wall(ax, ay, bx, by, area, begin, end, rays, field, step, ranges)
        ax, ay = bx, by


@kernel
def _lay_wall(
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
    """Lay the wall from a to b, in the frame of the sensor and seen from its left, over the rays.

    begin, end: its ends' rough directions; area: twice that of the triangle with the sensor.
    """
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
