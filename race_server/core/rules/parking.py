"""When a vehicle is parked: pure functions of where its body stands in the slot."""

import math
from typing import NamedTuple

from race_server.core import codes
from race_server.core.kernels.boxes import Hull, box_of
from race_server.core.kernels.geometry import cos_sin, wrap_angle
from race_server.core.kernels.jit import kernel
from race_server.core.state import Record

# A parked vehicle is aligned within this angle [rad], says the report on automatic parking of a
# kart, 2022.
ALIGNED_WITHIN = math.radians(10.0)


class Stand(NamedTuple):
    """How a body stands in a slot."""

    along: float  # [m] its middle is so far ahead of the slot's, in the direction of the slot
    across: float  # [m] and so far to the left of it
    turn: float  # [rad] its heading against the slot's


@kernel
def stand_in(parker: Record, hull: Hull) -> Stand:
    """Return how a body stands in the slot of a vehicle. parker: PARKER; hull: of the body."""
    box = box_of(hull)
    cos, sin = cos_sin(parker.heading)
    dx, dy = box.x - parker.x, box.y - parker.y
    turn = wrap_angle(hull.heading - parker.heading)
    return Stand(dx * cos + dy * sin, dy * cos - dx * sin, turn)


@kernel
def is_inside(parker: Record, hull: Hull, stand: Stand) -> bool:
    """Return whether all corners of a body lie inside its slot. parker: PARKER."""
    cos, sin = cos_sin(stand.turn)
    half_along = hull.half_length * abs(cos) + hull.half_width * abs(sin)
    half_across = hull.half_length * abs(sin) + hull.half_width * abs(cos)
    return bool(
        abs(stand.along) + half_along <= 0.5 * parker.length
        and abs(stand.across) + half_across <= 0.5 * parker.width
    )


@kernel
def is_parked(parker: Record, hull: Hull, stand: Stand, speed: float) -> bool:
    """Return whether a body stands in its slot as well as its tolerances ask.

    parker: PARKER; speed: of the body [m/s]. A tolerance of zero does not count.
    """
    square = stand.along * stand.along + stand.across * stand.across
    if parker.within > 0.0 and square >= parker.within * parker.within:
        return False
    if parker.along > 0.0 and abs(stand.along) >= parker.along:
        return False
    if parker.across > 0.0 and abs(stand.across) >= parker.across:
        return False
    if parker.turn > 0.0 and abs(stand.turn) > parker.turn:
        return False
    if parker.still > 0.0 and abs(speed) >= parker.still:
        return False
    return parker.fits == 0 or is_inside(parker, hull, stand)


@kernel
def ending_of(status: int, reason: int, touched: int) -> int:
    """Return how the way of a vehicle has ended, see `race_server.core.messages.Ending`.

    status: of its body; reason: Retirement; touched: what it ran into last, a RayHit.
    """
    if status == codes.FINISHED:
        return codes.IS_PARKED
    if status != codes.RETIRED:
        return codes.OPEN
    if reason == codes.TIME_OUT:
        return codes.IS_LATE
    if reason == codes.LEFT_LOT:
        return codes.HAS_LEFT
    if reason == codes.HIT_PERSON:
        return codes.MET_PERSON
    if reason != codes.CRASH:
        return codes.HAS_GONE
    if touched == codes.KART_HIT:
        return codes.MET_VEHICLE
    return codes.MET_BLOCK if touched == codes.OBSTACLE else codes.MET_WALL
