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
from race_server.core.kernels.jit import kernel
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


@kernel
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
