"""The box of a vehicle as its rear axle carries it, and the points that poses may be meant for."""

from enum import Enum
from typing import NamedTuple

import numpy as np

from race_server.core.kernels.boxes import Box, Hull, box_of
from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.jit import kernel
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle


class Point(Enum):
    """The point of a vehicle that a pose is meant for."""

    REAR_AXLE = "rear axle"  # of paths: it never moves sideways
    GRAVITY = "centre of gravity"  # of bodies in the world
    MIDDLE = "middle of the body"  # of slots


def distance_ahead(vehicle: Vehicle, point: Point) -> float:
    """Return how far [m] ahead of its rear axle a point of a vehicle lies."""
    if point is Point.REAR_AXLE:
        return 0.0
    return vehicle.rear_axle + (vehicle.box_offset if point is Point.MIDDLE else 0.0)


def convert(poses: Floats, vehicle: Vehicle, was: Point, becomes: Point) -> Floats:
    """Return poses of another point of the same vehicle.

    poses: (..., 3) x [m], y [m], heading [rad].
    """
    ahead = distance_ahead(vehicle, becomes) - distance_ahead(vehicle, was)
    moved = np.array(poses, float)
    moved[..., 0] += ahead * np.cos(moved[..., 2])
    moved[..., 1] += ahead * np.sin(moved[..., 2])
    return moved


class Footprint(NamedTuple):
    """The box that must stay free, and how tightly it turns."""

    middle: float  # [m] from the rear axle forward to the middle of the box
    half_length: float  # [m] with the margin
    half_width: float  # [m] with the margin
    radius: float  # [m] least turning radius of the rear axle


def footprint_of(vehicle: Vehicle, margin: float, lock: float) -> Footprint:
    """Return the box of a vehicle, grown by a margin [m] on all sides.

    lock: share of the vehicle's greatest curvature that paths may have.
    """
    return Footprint(
        middle=distance_ahead(vehicle, Point.MIDDLE),
        half_length=0.5 * vehicle.length + margin,
        half_width=0.5 * vehicle.width + margin,
        radius=vehicle.turning_radius / lock,
    )


@kernel
def box_at(footprint: Footprint, pose: Pose) -> Box:
    """Return where the box stands if the rear axle has a pose."""
    length, width = footprint.half_length, footprint.half_width
    return box_of(Hull(pose.x, pose.y, pose.heading, footprint.middle, length, width, 0))
