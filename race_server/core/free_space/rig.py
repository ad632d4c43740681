"""A vehicle with one trailer as planner and controllers see it, and how both move without slip.

Everything depends on the way driven, not on the speed. With the curvature k of the path of the rear
axle, the hitch d behind that axle, the bar L and the angle b at the hitch, positive where the
vehicle points to the left of the trailer,

    db/ds = k (1 + d/L cos b) - sin(b) / L,

where s is the way of the rear axle, negative in reverse (see `race_server.core.kernels.trailers`).
"""

import math
from typing import NamedTuple

import numpy as np

from race_server.core.free_space.footprint import Footprint, footprint_of
from race_server.core.kernels.boxes import Hull, box_of
from race_server.core.kernels.contacts import box_on_box
from race_server.core.kernels.geometry import Pose, along_arc, cos_sin
from race_server.core.kernels.jit import kernel
from race_server.core.vehicles import Trailer, Vehicle
from race_server.errors import PlanError

# The bar [m] of the lorry on which ways and gains were chosen; those of others are in proportion.
USUAL_BAR = 7.7
# Least radius [m] of a path of its trailer's axle, for estimates: with angles up to 48 degrees.
USUAL_RADIUS = 7.0
# Plans keep to this share of the greatest angle at the hitch, which is known to a step [rad].
ANGLE_SHARE, ANGLE_STEP = 0.9, 0.005
# Greatest angle that controllers ask for [rad], and as a share of what plans keep to.
SHARPEST, SHARPEST_SHARE = 0.75, 0.85
# Angles at the hitch that ways are made of, as shares of the greatest.
ANGLES = (0.0, 1 / 3, -1 / 3, 2 / 3, -2 / 3, 1.0, -1.0)
# By how much the wheels turn on a metre at most [rad/m], for a wheelbase of 3.7 m: a lorry that
# turns them by 0.5 rad/s drives at 1 m/s there. With 1 rad/m ways took a third longer.
TURNING, USUAL_WHEELBASE = 0.5, 3.7


class Rig(NamedTuple):
    """A vehicle and its trailer."""

    hitch: float  # [m] from the rear axle back to the hitch
    bar: float  # [m] from the hitch back to the axle of the trailer
    bend: float  # [1/m] greatest curvature of paths of the rear axle
    bending: float  # [1/m²] greatest change of curvature on a metre
    limit: float  # [rad] greatest angle at the hitch
    sharpest: float  # [rad] greatest angle that controllers ask for
    drawing: Footprint  # of the vehicle, carried by its rear axle
    drawn: Footprint  # of the trailer, carried by its axle


class Towed(NamedTuple):
    """Where a trailer stands, and the vehicle before it."""

    x: float  # [m] of the trailer's axle
    y: float  # [m]
    heading: float  # [rad] of the trailer
    angle: float  # [rad] at the hitch: heading of the vehicle minus that of the trailer
    curvature: float  # [1/m] to which the wheels are turned


def rig_of(vehicle: Vehicle, margin: float, lock: float) -> Rig:
    """Return a vehicle with its trailer, grown by a margin [m] on all sides.

    lock: share of the greatest curvature that paths may have.

    Raises:
        PlanError: it draws no trailer, or several.
    """
    trailer = only_trailer(vehicle)
    footprint, limit = footprint_of(vehicle, margin, lock), ANGLE_SHARE * touching_angle(vehicle)
    return Rig(
        hitch=trailer.hitch,
        bar=trailer.bar,
        bend=1.0 / footprint.radius,
        bending=TURNING * USUAL_WHEELBASE / vehicle.wheelbase**2,
        limit=limit,
        sharpest=min(SHARPEST, SHARPEST_SHARE * limit),
        drawing=footprint,
        drawn=Footprint(
            middle=trailer.box_offset,
            half_length=0.5 * trailer.length + margin,
            half_width=0.5 * trailer.width + margin,
            radius=_turning_radius(trailer, footprint.radius),
        ),
    )


def rig_of_car(vehicle: Vehicle, margin: float, lock: float) -> Rig:
    """Return a vehicle without trailer as one: its front axle draws the rear axle and the body.

    The angle at that hitch is the one of the wheels, so the path of the rear axle has the curvature
    tan(angle) / wheelbase.
    """
    footprint = footprint_of(vehicle, margin, lock)
    limit = math.atan(vehicle.wheelbase / footprint.radius)
    return Rig(
        hitch=0.0,
        bar=vehicle.wheelbase,
        bend=math.inf,
        bending=math.inf,
        limit=limit,
        sharpest=limit,
        drawing=Footprint(middle=0.0, half_length=0.0, half_width=0.0, radius=0.0),
        drawn=footprint,
    )


def touching_angle(vehicle: Vehicle) -> float:
    """Return the least angle at the hitch [rad] at which a trailer touches what draws it.

    At most the limit of the hitch. A trailer that reaches over what draws it, as a semitrailer
    does, touches it at no angle.
    """
    trailer = only_trailer(vehicle)
    length, width = 0.5 * vehicle.length, 0.5 * vehicle.width
    ahead = vehicle.rear_axle + vehicle.box_offset
    front = box_of(Hull(0.0, 0.0, 0.0, ahead, length, width, 0))
    length, width = 0.5 * trailer.length, 0.5 * trailer.width
    middle = trailer.box_offset - trailer.bar
    for angle in (0.0, *np.arange(ANGLE_STEP, trailer.limit, ANGLE_STEP).tolist()):
        rear = box_of(Hull(-trailer.hitch, 0.0, -angle, middle, length, width, 1))
        if box_on_box(front, rear)[0] > 0.0:
            return angle if angle > 0.0 else trailer.limit
    return trailer.limit


def _turning_radius(trailer: Trailer, radius: float) -> float:
    """Return the radius [m] on which the axle of a trailer is taken to turn at best.

    radius: of the rear axle ahead [m]. On a circle of that the trailer's axle has the radius
    sqrt(R² + d² - L²); where there is none, the angle at the hitch grows, and it turns as
    tightly as plans do.
    """
    square = radius**2 + trailer.hitch**2 - trailer.bar**2
    return max(math.sqrt(max(square, 0.0)), USUAL_RADIUS * scale_of(trailer.bar))


def only_trailer(vehicle: Vehicle) -> Trailer:
    """Return the trailer of a vehicle.

    Raises:
        PlanError: it draws none, or several.
    """
    if len(vehicle.trailers) != 1:
        raise PlanError(
            f"vehicle {vehicle.name!r} draws {len(vehicle.trailers)} trailers: a way is planned "
            "for a vehicle with one trailer, or without; choose another vehicle"
        )
    return vehicle.trailers[0]


@kernel
def is_towing(rig: Rig) -> bool:
    """Return whether there is a trailer: the front axle of a car has no body, see `rig_of_car`."""
    return rig.drawing.half_length > 0.0


@kernel
def scale_of(bar: float) -> float:
    """Return how large ways are for a bar [m], against those of the usual one."""
    return bar / USUAL_BAR


@kernel
def angle_rate(rig: Rig, angle: float, curvature: float) -> float:
    """Return by how much the angle at the hitch grows on a metre ahead [rad/m]."""
    cos, sin = cos_sin(angle)
    return curvature * (1.0 + rig.hitch / rig.bar * cos) - sin / rig.bar


@kernel
def curvature_of_rate(rig: Rig, angle: float, rate: float) -> float:
    """Return the curvature [1/m] on which the angle at the hitch grows by `rate` [rad/m]."""
    cos, sin = cos_sin(angle)
    return (rate + sin / rig.bar) / (1.0 + rig.hitch / rig.bar * cos)


@kernel
def pose_ahead(rig: Rig, towed: Towed) -> Pose:
    """Return the pose of the rear axle of the vehicle that draws a trailer."""
    cos, sin = cos_sin(towed.heading)
    heading = towed.heading + towed.angle
    ahead_cos, ahead_sin = cos_sin(heading)
    x = towed.x + rig.bar * cos + rig.hitch * ahead_cos
    y = towed.y + rig.bar * sin + rig.hitch * ahead_sin
    return Pose(x, y, heading)


@kernel
def towed_by(rig: Rig, pose: Pose, angle: float, curvature: float) -> Towed:
    """Return where the trailer stands behind a vehicle whose rear axle has a pose.

    angle: at the hitch [rad]; curvature: to which the wheels are turned [1/m].
    """
    ahead_cos, ahead_sin = cos_sin(pose.heading)
    heading = pose.heading - angle
    cos, sin = cos_sin(heading)
    x = pose.x - rig.hitch * ahead_cos - rig.bar * cos
    y = pose.y - rig.hitch * ahead_sin - rig.bar * sin
    return Towed(x, y, heading, angle, curvature)


@kernel
def angle_after(rig: Rig, angle: float, curvature: float, way: float) -> float:
    """Return the angle at the hitch [rad] after a short way [m] on an arc, by the midpoint rule."""
    half = angle + 0.5 * way * angle_rate(rig, angle, curvature)
    return angle + way * angle_rate(rig, half, curvature)


@kernel
def moved(rig: Rig, towed: Towed, curvature: float, way: float) -> Towed:
    """Return where the trailer stands after the vehicle drove a short way [m] on an arc."""
    pose = along_arc(pose_ahead(rig, towed), curvature, way)
    return towed_by(rig, pose, angle_after(rig, towed.angle, curvature, way), curvature)


@kernel
def way_behind(rig: Rig, angle: float, curvature: float) -> float:
    """Return how far [m] the trailer's axle moves along the trailer on a metre of the vehicle."""
    cos, sin = cos_sin(angle)
    return cos + rig.hitch * curvature * sin
