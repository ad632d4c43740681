"""Whether something stands between two places of a car park."""

import math

from race_server.core import codes
from race_server.core.kernels.boxes import Box, box_of
from race_server.core.kernels.geometry import ray_to_box
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.rays import cast_ray
from race_server.core.stages.blocks import block_hull
from race_server.core.state import World


@large_kernel
def stands_between(world: World, w: int, x: float, y: float, to_x: float, to_y: float) -> bool:
    """Return whether a wall or a block of one world is on the straight line from (x, y) [m].

    to_x, to_y: where it leads [m]. People and vehicles that drive do not count.
    """
    dx, dy = to_x - x, to_y - y
    length = math.sqrt(dx * dx + dy * dy)
    if length == 0.0:
        return False
    cos, sin = dx / length, dy / length
    site = world.walls.sites[world.rules[w].course]
    if cast_ray(world.walls, site, x, y, cos, sin, length)[1] >= 0:
        return True
    for block in world.parking.blocks[w]:
        if block.kind != codes.NOTHING:
            box = box_of(block_hull(block))
            if _way_to(box, x, y, cos, sin) < length:
                return True
    return False


@kernel
def _way_to(box: Box, x: float, y: float, cos: float, sin: float) -> float:
    """Return how far [m] from (x, y) a box is in a direction, infinite if it is not."""
    dx, dy = x - box.x, y - box.y
    return ray_to_box(
        dx * box.cos + dy * box.sin,
        dy * box.cos - dx * box.sin,
        cos * box.cos + sin * box.sin,
        sin * box.cos - cos * box.sin,
        box.half_length,
        box.half_width,
    )
