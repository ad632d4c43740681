"""The boxes that a body is made of, how they move, and how they yield to an impulse.

Contacts and sensors know the shape of a body through these kernels alone. A body consists of parts
that carry one box each. So far every vehicle is one part; the box of a trailer is a second one with
the trailer's pose.
"""

from typing import NamedTuple

from race_server.core.kernels.geometry import cos_sin
from race_server.core.kernels.jit import kernel
from race_server.core.state import Record


class Hull(NamedTuple):
    """A box as a part of a body carries it."""

    x: float  # [m] place of the part
    y: float  # [m]
    heading: float  # [rad] of the part
    offset: float  # [m] the box's middle lies so far ahead of (x, y)
    half_length: float  # [m]
    half_width: float  # [m]
    number: int  # of the box in its body


class Box(NamedTuple):
    """A box as it stands on the ground."""

    x: float  # [m] of its middle
    y: float  # [m]
    cos: float  # of its heading
    sin: float
    half_length: float  # [m]
    half_width: float  # [m]
    number: int  # of the box in its body


@kernel
def box_count(vehicle: Record) -> int:
    """Return how many boxes a vehicle is made of."""
    return 1


@kernel
def reach_of(vehicle: Record) -> float:
    """Return a distance [m] from the centre of gravity beyond which no box of the vehicle lies."""
    # Half a box's diagonal and its offset are less than its length.
    return vehicle.length


@kernel
def hull_of(vehicle: Record, body: Record, number: int) -> Hull:
    """Return a box of a body; number: from 0 to less than `box_count`."""
    return Hull(
        body.x,
        body.y,
        body.heading,
        vehicle.box_offset,
        0.5 * vehicle.length,
        0.5 * vehicle.width,
        number,
    )


@kernel
def grown(hull: Hull, room: float) -> Hull:
    """Return a hull with `room` [m] more on every side."""
    half_length, half_width = hull.half_length + room, hull.half_width + room
    return Hull(hull.x, hull.y, hull.heading, hull.offset, half_length, half_width, hull.number)


@kernel
def box_of(hull: Hull) -> Box:
    """Return where a hull stands."""
    cos, sin = cos_sin(hull.heading)
    x, y = hull.x + hull.offset * cos, hull.y + hull.offset * sin
    return Box(x, y, cos, sin, hull.half_length, hull.half_width, hull.number)


@kernel
def inertia_of(vehicle: Record, number: int) -> tuple[float, float]:
    """Return mass [kg] and yaw inertia [kg m²] of the part that carries a box."""
    return vehicle.mass, vehicle.yaw_inertia


@kernel
def velocity_at(body: Record, box: Box, px: float, py: float) -> tuple[float, float]:
    """Return the velocity [m/s] of a point of a part, in the frame of the world.

    body: BODY; box: of the part; px, py: from the part's place to the point, in the frame of the
    world [m].
    """
    vx = body.speed * box.cos - body.lateral_speed * box.sin - body.yaw_rate * py
    vy = body.speed * box.sin + body.lateral_speed * box.cos + body.yaw_rate * px
    return vx, vy


@kernel
def push(
    body: Record, vehicle: Record, box: Box, px: float, py: float, jx: float, jy: float
) -> None:
    """Apply an impulse to a part of a body.

    body: BODY, changed in place; vehicle: VEHICLE; box: of the part; px, py: from the part's place
    to the point, in the frame of the world [m]; jx, jy: impulse in the frame of the world [N s].
    """
    body.speed += (jx * box.cos + jy * box.sin) / vehicle.mass
    body.lateral_speed += (jy * box.cos - jx * box.sin) / vehicle.mass
    body.yaw_rate += (px * jy - py * jx) / vehicle.yaw_inertia
