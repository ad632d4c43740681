"""Contacts of oriented boxes with walls and with each other, and the impulses that follow."""

import math
from typing import NamedTuple

from race_server.core.kernels.boxes import Box
from race_server.core.kernels.geometry import clip
from race_server.core.kernels.jit import kernel

# How square a box must stand to a surface before a corner alone takes the blow. Softens the step
# between a corner and a whole side, so that a kart flat against a wall is not spun.
SIDE_BLEND = 12.0


@kernel
def box_on_segment(
    box: Box, x0: float, y0: float, x1: float, y1: float
) -> tuple[float, float, float]:
    """Return depth [m] and unit normal (towards the box) of a box on a segment.

    x0, y0, x1, y1: ends of the segment [m]. Depth is 0 where they do not touch. Separating axes:
    the segment's normal and the two axes of the box; the way out is along the one with the least
    overlap.
    """
    x, y, cos, sin = box.x, box.y, box.cos, box.sin
    half_length, half_width = box.half_length, box.half_width
    # Ends of the segment in the frame of the box.
    ax, ay = (x0 - x) * cos + (y0 - y) * sin, (y0 - y) * cos - (x0 - x) * sin
    bx, by = (x1 - x) * cos + (y1 - y) * sin, (y1 - y) * cos - (x1 - x) * sin
    ahead, behind = half_length - min(ax, bx), half_length + max(ax, bx)
    if ahead <= 0.0 or behind <= 0.0:
        return 0.0, 0.0, 0.0
    left, right = half_width - min(ay, by), half_width + max(ay, by)
    if left <= 0.0 or right <= 0.0:
        return 0.0, 0.0, 0.0
    ex, ey = bx - ax, by - ay
    length = math.sqrt(ex * ex + ey * ey)
    if length == 0.0:
        return 0.0, 0.0, 0.0
    nx, ny = -ey / length, ex / length
    side = -(ax * nx + ay * ny)  # from the line to the middle of the box
    if side < 0.0:
        nx, ny, side = -nx, -ny, -side
    depth = half_length * abs(nx) + half_width * abs(ny) - side
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    # A wall's end that pokes into the box is left along an axis of the box.
    if ahead < depth:
        depth, nx, ny = ahead, -1.0, 0.0
    if behind < depth:
        depth, nx, ny = behind, 1.0, 0.0
    if left < depth:
        depth, nx, ny = left, 0.0, -1.0
    if right < depth:
        depth, nx, ny = right, 0.0, 1.0
    return depth, nx * cos - ny * sin, nx * sin + ny * cos


@kernel
def box_on_box(box: Box, other: Box) -> tuple[float, float, float]:
    """Return depth [m] and unit normal (towards the first box) of two boxes; depth 0 if apart."""
    dx, dy = box.x - other.x, box.y - other.y
    ac = abs(box.cos * other.cos + box.sin * other.sin)
    as_ = abs(box.sin * other.cos - box.cos * other.sin)
    # Overlaps along the axes of the first and of the second box.
    u, v = dx * box.cos + dy * box.sin, dy * box.cos - dx * box.sin
    depth = box.half_length + other.half_length * ac + other.half_width * as_ - abs(u)
    if depth <= 0.0:
        return 0.0, 0.0, 0.0
    way = 1.0 if u >= 0.0 else -1.0
    nx, ny = way * box.cos, way * box.sin
    overlap = box.half_width + other.half_length * as_ + other.half_width * ac - abs(v)
    if overlap <= 0.0:
        return 0.0, 0.0, 0.0
    if overlap < depth:
        way = 1.0 if v >= 0.0 else -1.0
        depth, nx, ny = overlap, -way * box.sin, way * box.cos
    u, v = dx * other.cos + dy * other.sin, dy * other.cos - dx * other.sin
    overlap = other.half_length + box.half_length * ac + box.half_width * as_ - abs(u)
    if overlap <= 0.0:
        return 0.0, 0.0, 0.0
    if overlap < depth:
        way = 1.0 if u >= 0.0 else -1.0
        depth, nx, ny = overlap, way * other.cos, way * other.sin
    overlap = other.half_width + box.half_length * as_ + box.half_width * ac - abs(v)
    if overlap <= 0.0:
        return 0.0, 0.0, 0.0
    if overlap < depth:
        way = 1.0 if v >= 0.0 else -1.0
        depth, nx, ny = overlap, -way * other.sin, way * other.cos
    return depth, nx, ny


@kernel
def gap_between(box: Box, other: Box) -> float:
    """Return a distance [m] that two boxes have at least; not above 0 where they overlap.

    The largest distance along any axis of the two, as in `box_on_box`.
    """
    dx, dy = box.x - other.x, box.y - other.y
    ac = abs(box.cos * other.cos + box.sin * other.sin)
    as_ = abs(box.sin * other.cos - box.cos * other.sin)
    u, v = dx * box.cos + dy * box.sin, dy * box.cos - dx * box.sin
    along = abs(u) - box.half_length - other.half_length * ac - other.half_width * as_
    across = abs(v) - box.half_width - other.half_length * as_ - other.half_width * ac
    gap = max(along, across)
    u, v = dx * other.cos + dy * other.sin, dy * other.cos - dx * other.sin
    along = abs(u) - other.half_length - box.half_length * ac - box.half_width * as_
    across = abs(v) - other.half_width - box.half_length * as_ - box.half_width * ac
    return max(gap, along, across)


@kernel
def touching_point(box: Box, nx: float, ny: float) -> tuple[float, float]:
    """Return the point of a box, from its middle [m], that lies deepest against a unit normal."""
    along, across = nx * box.cos + ny * box.sin, ny * box.cos - nx * box.sin
    u = -box.half_length * clip(SIDE_BLEND * along, -1.0, 1.0)
    v = -box.half_width * clip(SIDE_BLEND * across, -1.0, 1.0)
    return u * box.cos - v * box.sin, u * box.sin + v * box.cos


class Material(NamedTuple):
    """How bodies and walls give back a blow."""

    restitution: float  # share of the approaching speed with which they part
    friction: float  # of Coulomb's law


@kernel
def impulse(
    closing: float, sliding: float, normal_mass: float, tangent_mass: float, material: Material
) -> tuple[float, float]:
    """Return impulses [N s] along normal and tangent of a blow.

    closing, sliding: relative velocity along normal (negative: approaching) and tangent [m/s];
    normal_mass, tangent_mass: effective masses at the point of contact [kg]. Coulomb's law bounds
    the tangent part.
    """
    if closing >= 0.0:
        return 0.0, 0.0
    normal = -(1.0 + material.restitution) * closing * normal_mass
    tangent = clip(-sliding * tangent_mass, -material.friction * normal, material.friction * normal)
    return normal, tangent
