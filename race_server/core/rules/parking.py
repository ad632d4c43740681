"""When a vehicle is parked: pure functions of where its boxes stand in the slot.

Each box of a vehicle with trailers has a place in the slot: where it would be if all stood
straight in the middle. Without trailers that is the middle of the slot.
"""

import math
from typing import NamedTuple

from race_server.core import codes
from race_server.core.kernels.boxes import Hull, box_count, box_of, hull_of
from race_server.core.kernels.geometry import cos_sin, wrap_angle
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.trailers import hitch_angle, place_in_line
from race_server.core.state import Record

# A parked vehicle is aligned within this angle [rad], says the report on automatic parking of a
# kart, 2022.
ALIGNED_WITHIN = math.radians(10.0)


class Stand(NamedTuple):
    """How a box stands against its place in a slot."""

    along: float  # [m] its middle is so far ahead of that place, in the direction of the slot
    across: float  # [m] and so far to the left of it
    turn: float  # [rad] its heading against the slot's


@kernel
def stand_in(parker: Record, hull: Hull) -> Stand:
    """Return how a box stands against the middle of a slot. parker: PARKER; hull: of the box."""
    box = box_of(hull)
    cos, sin = cos_sin(parker.heading)
    dx, dy = box.x - parker.x, box.y - parker.y
    turn = wrap_angle(hull.heading - parker.heading)
    return Stand(dx * cos + dy * sin, dy * cos - dx * sin, turn)


@kernel
def stand_of(parker: Record, vehicle: Record, body: Record, number: int) -> Stand:
    """Return how a box of a body stands against its place in the slot.

    parker: PARKER; vehicle: VEHICLE; body: BODY; number: of the box.
    """
    stand = stand_in(parker, hull_of(vehicle, body, number))
    return Stand(stand.along - place_in_line(vehicle, number), stand.across, stand.turn)


@kernel
def judged_box(parker: Record, vehicle: Record) -> int:
    """Return the number of the box that has to stand in its place. parker: PARKER."""
    return int(vehicle.trailer_count) if parker.last else 0


@kernel
def is_inside(parker: Record, hull: Hull, stand: Stand) -> bool:
    """Return whether all corners of a box lie inside a slot.

    parker: PARKER; stand: of the box against the middle of the slot.
    """
    half_along, half_across = turned_half(hull, stand.turn)
    return bool(
        abs(stand.along) + half_along <= 0.5 * parker.length
        and abs(stand.across) + half_across <= 0.5 * parker.width
    )


@kernel
def turned_half(hull: Hull, turn: float) -> tuple[float, float]:
    """Return half of what a box takes up along and across a slot [m] that it is turned in [rad]."""
    cos, sin = cos_sin(turn)
    half_along = hull.half_length * abs(cos) + hull.half_width * abs(sin)
    return half_along, hull.half_length * abs(sin) + hull.half_width * abs(cos)


@kernel
def is_parked(parker: Record, hull: Hull, stand: Stand, speed: float) -> bool:
    """Return whether a body without trailers stands in its slot as well as its tolerances ask.

    parker: PARKER; speed: of the body [m/s]. A tolerance of zero does not count.
    """
    return is_near(parker, stand, speed) and (parker.fits == 0 or is_inside(parker, hull, stand))


@kernel
def is_near(parker: Record, stand: Stand, speed: float) -> bool:
    """Return whether the middle of a box is near enough to its place. parker: PARKER."""
    square = stand.along * stand.along + stand.across * stand.across
    if parker.within > 0.0 and square >= parker.within * parker.within:
        return False
    if parker.along > 0.0 and abs(stand.along) >= parker.along:
        return False
    if parker.across > 0.0 and abs(stand.across) >= parker.across:
        return False
    if parker.turn > 0.0 and abs(stand.turn) > parker.turn:
        return False
    return not (parker.still > 0.0 and abs(speed) >= parker.still)


@kernel
def has_parked(parker: Record, vehicle: Record, body: Record, stand: Stand) -> bool:
    """Return whether a vehicle stands in its slot, with its trailers, as its tolerances ask.

    parker: PARKER; vehicle: VEHICLE; body: BODY; stand: of the box that is judged.
    """
    if not is_near(parker, stand, body.speed):
        return False
    for number in range(vehicle.trailer_count):
        if parker.hitch > 0.0 and abs(hitch_angle(body, number)) > parker.hitch:
            return False
    if parker.fits:
        for number in range(box_count(vehicle)):
            hull = hull_of(vehicle, body, number)
            if not is_inside(parker, hull, stand_in(parker, hull)):
                return False
    return True


@kernel
def goes_to_slot(body: Record, parker: Record) -> bool:
    """Return whether a kart whose race is over still drives to its slot. parker: PARKER."""
    return bool(body.status == codes.FINISHED and parker.length > 0.0 and parker.parked_tick == 0)


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
    if reason == codes.JACK_KNIFE:
        return codes.HAS_JACK_KNIFED
    if reason == codes.OWN_BODY:
        return codes.MET_ITSELF
    if reason != codes.CRASH:
        return codes.HAS_GONE
    if touched == codes.KART_HIT:
        return codes.MET_VEHICLE
    return codes.MET_BLOCK if touched == codes.OBSTACLE else codes.MET_WALL
