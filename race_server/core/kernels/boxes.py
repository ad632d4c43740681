"""The boxes that a body is made of, how they move, and how they yield to an impulse.

Contacts and sensors know the shape of a body through these kernels alone. A body consists of parts
that carry one box each: part 0 is the vehicle, part n its trailer n - 1, from the nearest on.

Who touches something with a trailer is moved off it as a whole, and the blow reaches the vehicle
through the hitches: a trailer has no mass, so it takes no impulse itself, and its motion follows.
"""

from typing import NamedTuple

from race_server.core.kernels.geometry import cos_sin
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.trailers import axle_motion, axle_pose, through_hitches
from race_server.core.state import Record, Records

# The tyres of a trailer hold against a blow across its axle; so much of the vehicle's own yielding
# is left, so that no impulse is infinite.
AXLE_YIELDS = 1e-6


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
    return 1 + vehicle.trailer_count


@kernel
def most_boxes(vehicles: Records) -> int:
    """Return how many boxes the vehicle has that is made of the most. vehicles: (K,) VEHICLE."""
    most = 1
    for vehicle in vehicles:
        most = max(most, box_count(vehicle))
    return most


@kernel
def reach_of(vehicle: Record) -> float:
    """Return a distance [m] from the centre of gravity beyond which no box of the vehicle lies."""
    # Half a box's diagonal and its offset are less than its length.
    return vehicle.length if vehicle.trailer_count == 0 else _reach_with_trailers(vehicle)


@large_kernel
def _reach_with_trailers(vehicle: Record) -> float:
    """Return the reach of a vehicle with trailers [m], however they stand."""
    reach, hitch = vehicle.length, vehicle.rear_axle
    for number in range(vehicle.trailer_count):
        drawn = vehicle.trailers[number]
        hitch += abs(drawn.hitch)
        reach = max(reach, hitch + max(drawn.ahead, drawn.bar + drawn.behind) + 0.5 * drawn.width)
        hitch += drawn.bar
    return reach


@kernel
def hull_of(vehicle: Record, body: Record, number: int) -> Hull:
    """Return a box of a body; number: from 0 to less than `box_count`."""
    if number > 0:
        return _hull_of_trailer(vehicle, body, number)
    return Hull(
        body.x,
        body.y,
        body.heading,
        vehicle.box_offset,
        0.5 * vehicle.length,
        0.5 * vehicle.width,
        number,
    )


@large_kernel
def _hull_of_trailer(vehicle: Record, body: Record, number: int) -> Hull:
    """Return the box of trailer `number` - 1 of a body."""
    axle, drawn = axle_pose(body, vehicle, number), vehicle.trailers[number - 1]
    offset = 0.5 * (drawn.ahead + drawn.bar - drawn.behind)
    half_length = 0.5 * (drawn.ahead + drawn.bar + drawn.behind)
    return Hull(axle.x, axle.y, axle.heading, offset, half_length, 0.5 * drawn.width, number)


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
def yielding(
    body: Record, vehicle: Record, box: Box, px: float, py: float, nx: float, ny: float
) -> tuple[float, float]:
    """Return how much a part yields to an impulse, by moving and by turning the vehicle [1/kg].

    body: BODY; vehicle: VEHICLE; box: of the part; px, py: from the part's place to the point, in
    the frame of the world [m]; nx, ny: direction of the impulse, of length 1.
    """
    if box.number > 0:
        ahead, across, turn = _through_trailers(body, vehicle, box, px, py, nx, ny)
        moved = max(ahead * ahead + across * across, AXLE_YIELDS) / vehicle.mass
        return moved, turn * turn / vehicle.yaw_inertia
    lever = px * ny - py * nx
    return 1.0 / vehicle.mass, lever * lever / vehicle.yaw_inertia


@kernel
def _through_trailers(
    body: Record, vehicle: Record, box: Box, px: float, py: float, jx: float, jy: float
) -> tuple[float, float, float]:
    """Return what an impulse on a trailer's point does to the vehicle, see `through_hitches`."""
    along, moment = jx * box.cos + jy * box.sin, px * jy - py * jx
    return through_hitches(body, vehicle, box.number, along, moment)


@kernel
def velocity_at(
    body: Record, vehicle: Record, box: Box, px: float, py: float
) -> tuple[float, float]:
    """Return the velocity [m/s] of a point of a part, in the frame of the world.

    body: BODY; vehicle: VEHICLE; box: of the part; px, py: from the part's place to the point, in
    the frame of the world [m].
    """
    speed, lateral_speed, yaw_rate = body.speed, body.lateral_speed, body.yaw_rate
    if box.number > 0:
        speed, yaw_rate = axle_motion(body, vehicle, box.number)
        lateral_speed = 0.0
    vx = speed * box.cos - lateral_speed * box.sin - yaw_rate * py
    vy = speed * box.sin + lateral_speed * box.cos + yaw_rate * px
    return vx, vy


@kernel
def push(
    body: Record, vehicle: Record, box: Box, px: float, py: float, jx: float, jy: float
) -> None:
    """Apply an impulse to a part of a body.

    body: BODY, changed in place; vehicle: VEHICLE; box: of the part; px, py: from the part's place
    to the point, in the frame of the world [m]; jx, jy: impulse in the frame of the world [N s].
    """
    ahead, across = jx * box.cos + jy * box.sin, jy * box.cos - jx * box.sin
    turn = px * jy - py * jx
    if box.number > 0:
        ahead, across, turn = _through_trailers(body, vehicle, box, px, py, jx, jy)
    body.speed += ahead / vehicle.mass
    body.lateral_speed += across / vehicle.mass
    body.yaw_rate += turn / vehicle.yaw_inertia
