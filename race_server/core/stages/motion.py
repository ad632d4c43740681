"""Motion of bodies under what their drivers ask for. Free of rules of the game."""

from race_server.core import codes
from race_server.core.clock import SUBSTEP_S
from race_server.core.kernels.geometry import wrap_angle
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.motion import Allowance, Command, Motion, move
from race_server.core.kernels.trailers import lead_trailers
from race_server.core.rules.effects import surface_roll
from race_server.core.state import Record, Records


@kernel
def move_bodies(bodies: Records, vehicles: Records) -> None:
    """Move every simulated body by one substep; those that no longer race brake.

    But one that has finished and goes to a slot drives on: it is allowed a speed.

    bodies: (K,) BODY of one world; vehicles: (K,) VEHICLE.
    """
    for k in range(len(bodies)):
        body = bodies[k]
        if body.status != codes.ABSENT and body.trust == codes.SIMULATED:
            _move_body(body, vehicles[k])


@kernel
def _move_body(body: Record, vehicle: Record) -> None:
    """Move one body by a substep."""
    throttle, brake = body.throttle, body.brake
    goes_on = body.status == codes.FINISHED and body.speed_cap > 0.0
    if body.status != codes.RACING and not goes_on:
        throttle, brake = 0.0, 1.0
    roll = surface_roll(body.surface)
    moved = move(
        vehicle,
        motion_of(body),
        Command(body.steering_command, throttle, brake),
        Allowance(body.speed_cap, body.thrust_scale, body.grip_scale, roll),
        SUBSTEP_S,
    )
    lead_trailers(body, vehicle, moved, SUBSTEP_S)
    body.x, body.y, body.heading = moved.x, moved.y, wrap_angle(moved.heading)
    body.speed, body.lateral_speed = moved.speed, moved.lateral_speed
    body.yaw_rate, body.steering = moved.yaw_rate, moved.steering


@kernel
def motion_of(body: Record) -> Motion:
    """Return pose and speeds of a body."""
    return Motion(
        body.x,
        body.y,
        body.heading,
        body.speed,
        body.lateral_speed,
        body.yaw_rate,
        body.steering,
    )
