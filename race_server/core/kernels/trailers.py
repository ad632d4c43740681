"""Motion of trailers behind what draws them, without slip and without force.

Axle 0 is the rear axle of the vehicle, axle i that of trailer i - 1. The angle at a hitch is the
heading of what draws minus that of what is drawn: positive where the former points left of the
latter. The axle of a trailer moves along it, so that with the velocity (u, w) of its hitch along
and across what draws it, and the angle b,

    yaw rate = (u sin b + w cos b) / bar,    speed = u cos b - w sin b.

Without slip u is the speed of the axle ahead and w = -hitch * its yaw rate: the usual model of a
car with n trailers (Laumond, Robot Motion Planning and Control, 1998). With slip w holds the slide.
"""

from race_server.core.kernels.geometry import Pose, cos_sin, wrap_angle
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.motion import Motion
from race_server.core.state import Record


@kernel
def hitch_angle(body: Record, number: int) -> float:
    """Return the angle [rad] at a hitch. body: BODY; number: of the trailer behind it, from 0."""
    ahead = body.heading if number == 0 else body.trailers[number - 1].heading
    return wrap_angle(ahead - body.trailers[number].heading)


@kernel
def turning_of(u: float, w: float, angle: float, bar: float) -> float:
    """Return the yaw rate [rad/s] of a trailer.

    u, w: velocity of its hitch along and across what draws it [m/s]; angle: at the hitch [rad];
    bar: [m].
    """
    cos, sin = cos_sin(angle)
    return (u * sin + w * cos) / bar


@kernel
def lead_trailers(body: Record, vehicle: Record, moved: Motion, dt: float) -> None:
    """Turn the trailers of a body that is about to move; changes `body.trailers` alone.

    body: BODY at the start of the step; vehicle: VEHICLE; moved: the motion after `dt` [s], whose
    speeds hold during all of the step. The angles of the middle of the step decide (midpoint
    rule), and cost two of `cos_sin` for each trailer.
    """
    heading, yaw_rate, u = body.heading, moved.yaw_rate, moved.speed
    w = moved.lateral_speed - vehicle.rear_axle * yaw_rate
    for number in range(vehicle.trailer_count):
        drawn, trailer = vehicle.trailers[number], body.trailers[number]
        w -= drawn.hitch * yaw_rate
        start = trailer.heading
        angle = heading - start
        half = 0.5 * dt * (yaw_rate - turning_of(u, w, angle, drawn.bar))
        cos, sin = cos_sin(wrap_angle(angle + half))
        trailer.yaw_rate = (u * sin + w * cos) / drawn.bar
        trailer.heading = wrap_angle(start + dt * trailer.yaw_rate)
        heading, yaw_rate, u, w = start, trailer.yaw_rate, u * cos - w * sin, 0.0


@large_kernel
def axle_pose(body: Record, vehicle: Record, number: int) -> Pose:
    """Return the pose of an axle: of the vehicle's rear axle for 0, of trailer `number` - 1 else.

    body: BODY; vehicle: VEHICLE.
    """
    cos, sin = cos_sin(body.heading)
    heading = body.heading
    x, y = body.x - vehicle.rear_axle * cos, body.y - vehicle.rear_axle * sin
    for trailer in range(number):
        drawn = vehicle.trailers[trailer]
        x, y = x - drawn.hitch * cos, y - drawn.hitch * sin
        heading = body.trailers[trailer].heading
        cos, sin = cos_sin(heading)
        x, y = x - drawn.bar * cos, y - drawn.bar * sin
    return Pose(x, y, heading)


@kernel
def straighten(body: Record, vehicle: Record) -> None:
    """Put the trailers of a body in line behind it, at rest. body: BODY; vehicle: VEHICLE."""
    for number in range(vehicle.trailer_count):
        body.trailers[number].heading = body.heading
        body.trailers[number].yaw_rate = 0.0


@large_kernel
def axle_motion(body: Record, vehicle: Record, number: int) -> tuple[float, float]:
    """Return speed [m/s] and yaw rate [rad/s] of the axle of trailer `number` - 1.

    body: BODY; vehicle: VEHICLE. They follow from the motion of the body as it is now, also after
    a blow.
    """
    u, yaw_rate = body.speed, body.yaw_rate
    w = body.lateral_speed - vehicle.rear_axle * yaw_rate
    for trailer in range(number):
        drawn = vehicle.trailers[trailer]
        w -= drawn.hitch * yaw_rate
        cos, sin = cos_sin(hitch_angle(body, trailer))
        u, w, yaw_rate = u * cos - w * sin, 0.0, (u * sin + w * cos) / drawn.bar
    return u, yaw_rate


@large_kernel
def through_hitches(
    body: Record, vehicle: Record, number: int, ahead: float, turn: float
) -> tuple[float, float, float]:
    """Return what a blow on trailer `number` - 1 does to the vehicle that draws it.

    body: BODY; vehicle: VEHICLE; ahead: impulse along the trailer's axle [N s], turn: its moment
    about the axle [N m s]. Impulses along and across the vehicle, and the moment about its centre
    of gravity: those that do the same work at every motion that the hitches allow, since trailers
    have no mass.
    """
    across = 0.0
    for before in range(number):
        trailer = number - 1 - before
        drawn = vehicle.trailers[trailer]
        cos, sin = cos_sin(hitch_angle(body, trailer))
        ahead, across = ahead * cos + turn * sin / drawn.bar, turn * cos / drawn.bar - ahead * sin
        turn = -drawn.hitch * across
    return ahead, across, turn - vehicle.rear_axle * across


@kernel
def place_in_line(vehicle: Record, number: int) -> float:
    """Return how far ahead [m] of the middle of a straight vehicle the middle of a box lies.

    vehicle: VEHICLE; number: of the box. 0 for a vehicle without trailers.
    """
    return line_up_boxes(vehicle, number) if vehicle.trailer_count > 0 else 0.0


@large_kernel
def line_up_boxes(vehicle: Record, number: int) -> float:
    """Return the same for a vehicle with trailers. vehicle: VEHICLE."""
    front, rear, wanted = 0.0, 0.0, 0.0
    axle = -vehicle.rear_axle  # all from the centre of gravity, forward
    for box in range(vehicle.trailer_count + 1):
        if box == 0:
            first = vehicle.box_offset + 0.5 * vehicle.length
            last = vehicle.box_offset - 0.5 * vehicle.length
        else:
            drawn = vehicle.trailers[box - 1]
            first = axle - drawn.hitch + drawn.ahead
            axle -= drawn.hitch + drawn.bar
            last = axle - drawn.behind
        front, rear = (first, last) if box == 0 else (max(front, first), min(rear, last))
        if box == number:
            wanted = 0.5 * (first + last)
    return wanted - 0.5 * (front + rear)
