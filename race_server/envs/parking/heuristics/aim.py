"""Where a vehicle stands and where it is to stand, in the points that heuristics ask for."""

import math
from typing import NamedTuple

from race_server.core.kernels.boxes import box_of, hull_of
from race_server.core.kernels.geometry import Pose, cos_sin
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.trailers import axle_pose, hitch_angle, place_in_line
from race_server.core.rules.parking import judged_box
from race_server.core.state import Record

# Reckoned with as the largest angle [rad] of a hitch that may turn farther: a longer way beyond it
# is no longer that of a car.
MOST_BEND = math.radians(60.0)


class Aim(NamedTuple):
    """A vehicle, and the same vehicle parked straight in its slot."""

    middle: Pose  # of the box that is judged
    axle: Pose  # the rear axle
    last: Pose  # the axle of the last trailer; without one the rear axle
    goal_middle: Pose
    goal_axle: Pose
    goal_last: Pose
    radius: float  # [m] least of the rear axle's path
    bar: float  # [m] of the last trailer; 0 without one
    bend: float  # [rad] largest angle at its hitch, at most `MOST_BEND`
    bent: float  # [m] sum of bar times angle over all hitches


@kernel
def goal_of(vehicle: Record, parker: Record) -> Pose:
    """Return where the middle of the box that is judged is to be.

    vehicle: VEHICLE; parker: PARKER.
    """
    ahead = place_in_line(vehicle, judged_box(parker, vehicle))
    cos, sin = cos_sin(parker.heading)
    return Pose(parker.x + ahead * cos, parker.y + ahead * sin, parker.heading)


@kernel
def middle_of(body: Record, vehicle: Record, parker: Record) -> Pose:
    """Return where the middle of the box that is judged is.

    body: BODY; vehicle: VEHICLE; parker: PARKER.
    """
    hull = hull_of(vehicle, body, judged_box(parker, vehicle))
    box = box_of(hull)
    return Pose(box.x, box.y, hull.heading)


@kernel
def aim_of(body: Record, vehicle: Record, parker: Record) -> Aim:
    """Return the aim of a vehicle. body: BODY; vehicle: VEHICLE; parker: PARKER."""
    axle = place_in_line(vehicle, 0) - vehicle.box_offset - vehicle.rear_axle
    cos, sin = cos_sin(parker.heading)
    x, y = parker.x + axle * cos, parker.y + axle * sin
    behind, bent, bar, bend = 0.0, 0.0, 0.0, 0.0
    for number in range(vehicle.trailer_count):
        drawn = vehicle.trailers[number]
        bar, bend = drawn.bar, min(drawn.limit, MOST_BEND)
        behind += drawn.hitch + bar
        bent += bar * abs(hitch_angle(body, number))
    return Aim(
        middle_of(body, vehicle, parker),
        axle_pose(body, vehicle, 0),
        axle_pose(body, vehicle, vehicle.trailer_count),
        goal_of(vehicle, parker),
        Pose(x, y, parker.heading),
        Pose(x - behind * cos, y - behind * sin, parker.heading),
        (vehicle.front_axle + vehicle.rear_axle) / math.tan(vehicle.steering_limit),
        bar,
        bend,
        bent,
    )
