"""What one seat sees of a car park: its own place, and the slot that it goes to."""

import math

from race_server.core.clock import TICK_S
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.trailers import hitch_angle, place_in_line
from race_server.core.rules.parking import stand_of
from race_server.core.stages import observed_parts as part
from race_server.core.stages.observed_parts import KartFrame, put
from race_server.core.state import Float32s, Ints, Record, World
from race_server.core.vehicles import TRAILERS


@kernel
def fill_lot(world: World, w: int, k: int, frame: KartFrame, offsets: Ints, out: Float32s) -> None:
    """Fill where the middle of the body is, and how it moves, in the frame of the lot."""
    body, offset = world.bodies[w, k], world.vehicles[w, k].box_offset
    cos, sin = frame.cos, frame.sin
    x, y = body.x + offset * cos, body.y + offset * sin
    along = body.speed * cos - body.lateral_speed * sin
    across = body.speed * sin + body.lateral_speed * cos
    put(out, offsets[part.POSITION_X], 0, x)
    put(out, offsets[part.POSITION_Y], 0, y)
    put(out, offsets[part.HEADING], 0, wrap_angle(body.heading))
    put(out, offsets[part.HEADING_COS], 0, cos)
    put(out, offsets[part.HEADING_SIN], 0, sin)
    put(out, offsets[part.VELOCITY_X], 0, along)
    put(out, offsets[part.VELOCITY_Y], 0, across)
    _put_direction(out, offsets[part.POSITION_UNIT], x, y)
    _put_direction(out, offsets[part.VELOCITY_UNIT], along, across)


@kernel
def _put_direction(out: Float32s, offset: int, x: float, y: float) -> None:
    """Fill the part at `offset` with a vector divided by its length; zeros where it has none."""
    length = math.sqrt(x * x + y * y)
    scale = 1.0 / length if length > 0.0 else 0.0
    put(out, offset, 0, scale * x)
    put(out, offset, 1, scale * y)


@kernel
def fill_hitches(body: Record, vehicle: Record, offsets: Ints, out: Float32s) -> None:
    """Fill the angles at the hitches; 0 where there is none."""
    for number in range(TRAILERS):
        angle = hitch_angle(body, number) if number < vehicle.trailer_count else 0.0
        if number == 0:
            put(out, offsets[part.HITCH], 0, angle)
        else:
            put(out, offsets[part.HITCH_BEHIND], number - 1, angle)


@kernel
def fill_goal(world: World, w: int, k: int, frame: KartFrame, offsets: Ints, out: Float32s) -> None:
    """Fill the slot that a vehicle goes to; zeros where it goes to none."""
    parkers = world.parking.parkers[w]
    if len(parkers) == 0 or parkers[k].length <= 0.0:
        for number in part.GOAL:
            put(out, offsets[number], 0, 0.0)
        for number in part.GOAL_UNITS:
            put(out, offsets[number], 1, 0.0)
        return
    _fill_slot(parkers[k], world.bodies[w, k], world.vehicles[w, k], frame, offsets, out)


@kernel
def _fill_slot(
    parker: Record, body: Record, vehicle: Record, frame: KartFrame, offsets: Ints, out: Float32s
) -> None:
    """Fill a slot, seen from the middle of the body. parker: PARKER."""
    x, y, turned = parker.x, parker.y, body.heading
    if vehicle.trailer_count > 0:
        # The body's own place in the slot, when all stands straight in the middle.
        ahead = place_in_line(vehicle, 0)
        x, y = x + ahead * math.cos(parker.heading), y + ahead * math.sin(parker.heading)
        turned = body.trailers[vehicle.trailer_count - 1].heading
    dx = x - body.x - vehicle.box_offset * frame.cos
    dy = y - body.y - vehicle.box_offset * frame.sin
    forward, left = dx * frame.cos + dy * frame.sin, dy * frame.cos - dx * frame.sin
    distance = math.sqrt(dx * dx + dy * dy)
    turn = wrap_angle(parker.heading - body.heading)
    put(out, offsets[part.GOAL_X], 0, forward)
    put(out, offsets[part.GOAL_Y], 0, left)
    if offsets[part.GOAL_COS] >= 0:
        put(out, offsets[part.GOAL_COS], 0, math.cos(turn))
    if offsets[part.GOAL_SIN] >= 0:
        put(out, offsets[part.GOAL_SIN], 0, math.sin(turn))
    put(out, offsets[part.GOAL_DISTANCE], 0, distance)
    put(out, offsets[part.GOAL_PROXIMITY], 0, 1.0 / (1.0 + distance))
    if offsets[part.GOAL_BEARING] >= 0:
        put(out, offsets[part.GOAL_BEARING], 0, math.atan2(left, forward))
    put(out, offsets[part.PARKED_FOR], 0, parker.held_ticks * TICK_S)
    put(out, offsets[part.GOAL_TURN], 0, turn)
    put(out, offsets[part.TRAILER_ERROR], 0, wrap_angle(parker.heading - turned))
    if offsets[part.TRAILER_ALONG] >= 0 or offsets[part.TRAILER_ACROSS] >= 0:
        last = stand_of(parker, vehicle, body, vehicle.trailer_count)
        put(out, offsets[part.TRAILER_ALONG], 0, last.along)
        put(out, offsets[part.TRAILER_ACROSS], 0, last.across)
    put(out, offsets[part.GEAR], 0, parker.gear)
    put(out, offsets[part.SLOT_X], 0, x)
    put(out, offsets[part.SLOT_Y], 0, y)
    put(out, offsets[part.SLOT_HEADING], 0, wrap_angle(parker.heading))
    put(out, offsets[part.TO_SLOT_X], 0, dx)
    put(out, offsets[part.TO_SLOT_Y], 0, dy)
    _put_direction(out, offsets[part.SLOT_UNIT], x, y)
    _put_direction(out, offsets[part.TO_SLOT_UNIT], dx, dy)
