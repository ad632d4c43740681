"""Fans of rays, and the exact range of one ray to borders and obstacles on a uniform grid."""

import math
from typing import NamedTuple

from race_server.core.kernels.jit import kernel
from race_server.core.state import Floats, Record, Walls

# Moves a ray just across the edge of a cell. The grid lists a wall in every cell that comes
# within ten times this distance of it.
NUDGE = 1e-7


class Fan(NamedTuple):
    """The rays of one sensor of one kart, evenly spaced, ray 0 the rightmost."""

    x: float  # of the sensor [m]
    y: float
    cos: float  # of the direction in which the sensor looks
    sin: float
    rays: Floats  # (R, 2) cosine and sine of each ray in the frame of the sensor
    field: float  # angle between the outermost rays [rad]
    reach: float  # [m]


@kernel
def cast_ray(
    walls: Walls, site: Record, x: float, y: float, cos: float, sin: float, reach: float
) -> tuple[float, int]:
    """Return distance [m] and number of the first wall that a ray meets.

    site: SITE; x, y: start of the ray [m]; cos, sin: of its direction; reach: [m]. The number is -1
    and the distance `reach` where no wall is nearer. Cells that hold walls are visited in order;
    over empty ones the ray skips a whole free box ahead.
    """
    size = site.cell
    columns, rows = site.columns, site.rows
    first_cell, first_wall = site.cell_start, site.wall_start
    scale = 1.0 / size
    gx, gy = (x - site.x0) * scale, (y - site.y0) * scale
    inverse_x = 1.0 / cos if cos != 0.0 else math.inf
    inverse_y = 1.0 / sin if sin != 0.0 else math.inf
    octant = (0 if cos > 0.0 else 1) + (0 if sin > 0.0 else 2) + (4 if abs(sin) > abs(cos) else 0)
    best, wall = reach, -1
    travelled = 0.0
    while travelled < best:
        column = math.floor(gx + travelled * scale * cos)
        row = math.floor(gy + travelled * scale * sin)
        if column < 0 or row < 0 or column >= columns or row >= rows:
            break
        cell = first_cell + row * columns + column
        wide, high = int(walls.cell_free[cell, octant, 0]), int(walls.cell_free[cell, octant, 1])
        if wide == 0:
            for entry in range(walls.cell_first[cell], walls.cell_first[cell + 1]):
                number = first_wall + walls.cell_walls[entry]
                x0, y0 = walls.segments[number, 0], walls.segments[number, 1]
                ex, ey = walls.segments[number, 2] - x0, walls.segments[number, 3] - y0
                along = cos * ey - sin * ex
                dx, dy = x0 - x, y0 - y
                # Both ends count; a share outside [0, along] misses. No division until it hits.
                share = dx * sin - dy * cos
                distance = dx * ey - dy * ex
                if along < 0.0:
                    along, share, distance = -along, -share, -distance
                if 0.0 <= share <= along and 0.0 <= distance < best * along:
                    best = distance / along
                    wall = number
            wide = high = 1
        # Leave the free box ahead, which has this cell in a corner.
        edge_x = column + wide if cos > 0.0 else column - wide + 1
        edge_y = row + high if sin > 0.0 else row - high + 1
        leave_x = (edge_x - gx) * size * inverse_x if cos != 0.0 else math.inf
        leave_y = (edge_y - gy) * size * inverse_y if sin != 0.0 else math.inf
        following = min(leave_x, leave_y) + NUDGE
        # Along an edge rounding may keep a ray in the cell that it has left: then on to the next.
        travelled = following if following > travelled else max(leave_x, leave_y) + NUDGE
    return best, wall
