"""Drives a vehicle with a trailer along its path, forward and back.

Ahead the vehicle follows its own path, and the trailer comes behind. In reverse the axle of the
trailer is what is led: how far it is off decides the angle at the hitch, and that angle the wheels,
on top of what the path itself asks for. So a track holds the vehicle's rear axle where it leads
ahead, and the trailer's axle where it leads back.
"""

from itertools import pairwise

import numpy as np

from race_agents.planning.path_follower import (
    ANGLE,
    COLUMNS,
    CURVATURE,
    GEAR,
    HEADING,
    LAST,
    LEFT,
    SPEED,
    Spot,
    X,
    Y,
    drive_on,
    leading_point,
    locate,
    paced,
    pursue,
    speed_limits,
)
from race_agents.planning.reversing import angle_towards, curvature_towards
from race_agents.planning.towed_path import TowedPath, before, behind
from race_server.core.free_space.rig import Rig, angle_rate, towed_by, way_behind
from race_server.core.kernels.geometry import Pose, cos_sin, wrap_angle
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.motion import Command, Motion
from race_server.core.state import Floats, Record
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError

# Distance of the point that is pursued ahead, in wheelbases.
PURSUIT = 0.7
# Least share of the vehicle's way that its trailer's axle is taken to move.
LEAST_RATIO = 0.3


def make_towed_track(path: TowedPath, vehicle: Vehicle, cruise: float) -> Floats:
    """Return a path made ready for a vehicle with a trailer: (S, COLUMNS), leg after leg.

    cruise: most speed [m/s], which the vehicle's limits may lower.

    Raises:
        PlanError: the path has no arcs.
    """
    if len(path.arcs) == 0:
        raise PlanError("a path without arcs cannot be followed: the vehicle is at its goal")
    ways = path.arcs[:, 1]
    cuts = [0, *(np.flatnonzero(np.diff(np.sign(ways))) + 1).tolist(), len(ways)]
    legs: list[Floats] = []
    for first, after in pairwise(cuts):
        points = slice(first, after + 1)
        arcs = path.arcs[first:after]
        leg = _leg(path.poses[points], path.angles[points], arcs, vehicle, cruise)
        leg[:, LAST] = sum(len(other) for other in legs) + len(leg) - 1
        legs.append(leg)
    return np.concatenate(legs)


def _leg(poses: Floats, angles: Floats, arcs: Floats, vehicle: Vehicle, cruise: float) -> Floats:
    """Return the points of a path in one direction.

    poses: (S + 1, 3) of the rear axle; angles: (S + 1,) at the hitch [rad]; arcs: (S, 2).
    """
    trailer, ways, gear = vehicle.trailers[0], np.abs(arcs[:, 1]), float(np.sign(arcs[0, 1]))
    curvatures = np.concatenate([arcs[:1, 0], 0.5 * (arcs[1:, 0] + arcs[:-1, 0]), arcs[-1:, 0]])
    limits = speed_limits(curvatures, ways, gear, vehicle, cruise)
    guided, steps = poses, ways
    if gear < 0.0:
        guided = behind(poses, angles, trailer)
        steps = np.maximum(np.hypot(*np.diff(guided[:, :2], axis=0).T), LEAST_RATIO * ways)
        limits = limits * steps / ways
    leg = np.zeros((len(poses), COLUMNS))
    leg[:, X], leg[:, Y], leg[:, HEADING] = guided.T
    leg[:, CURVATURE], leg[:, ANGLE], leg[:, GEAR] = curvatures, angles, gear
    leg[:, SPEED] = paced(limits, steps, vehicle)
    leg[:-1, LEFT] = np.cumsum(steps[::-1])[::-1]
    return leg


def rear_axles(track: Floats, vehicle: Vehicle) -> Floats:
    """Return the poses of the rear axle on points of a track, (S, 3), with or without a trailer."""
    axles = track[:, [X, Y, HEADING]]
    if vehicle.trailers:
        back = track[:, GEAR] < 0.0
        axles[back] = before(axles[back], track[back, ANGLE], vehicle.trailers[0])
    return axles


@kernel
def axle_of(vehicle: Record, motion: Motion) -> Pose:
    """Return the pose of the rear axle of a vehicle. motion: of its centre of gravity."""
    cos, sin = cos_sin(wrap_angle(motion.heading))
    x, y = motion.x - vehicle.rear_axle * cos, motion.y - vehicle.rear_axle * sin
    return Pose(x, y, motion.heading)


@kernel
def guided_axle(rig: Rig, pose: Pose, angle: float, gear: float) -> Pose:
    """Return the pose of the axle that is led: the rear axle ahead, the trailer's in reverse.

    pose: of the rear axle; angle: at the hitch [rad].
    """
    if gear > 0.0:
        return pose
    towed = towed_by(rig, pose, angle, 0.0)
    return Pose(towed.x, towed.y, towed.heading)


@kernel
def _curvature_back(
    track: Floats, spot: Spot, rig: Rig, led: Pose, angle: float, speed: float
) -> float:
    """Return the curvature [1/m] that leads the axle of the trailer back to its track."""
    point, share = spot.point, spot.share
    cos, sin = cos_sin(wrap_angle(track[point, HEADING]))
    offset = (led.y - track[point, Y]) * cos - (led.x - track[point, X]) * sin
    ahead = wrap_angle(track[point + 1, HEADING] - track[point, HEADING])
    turn = wrap_angle(led.heading - track[point, HEADING] - share * ahead)
    planned = track[point, ANGLE] + share * (track[point + 1, ANGLE] - track[point, ANGLE])
    wanted = angle_towards(rig, offset, turn, planned, -1.0)
    curvature = track[leading_point(track, spot, speed), CURVATURE]
    rate = -angle_rate(rig, planned, curvature)
    return curvature_towards(rig, angle, wanted, rate, -1.0)


@large_kernel
def follow_towed(
    track: Floats,
    progress: Floats,
    vehicle: Record,
    rig: Rig,
    motion: Motion,
    angle: float,
    cap: float,
) -> Command:
    """Return what to do now to stay on a track; at its end the brakes hold.

    track: (S, COLUMNS); progress: (1,) number of the point that was passed last, moved on here;
    vehicle: VEHICLE; motion: of the centre of gravity; angle: at the hitch [rad]; cap: most speed
    [m/s], above it all brakes act.
    """
    pose = axle_of(vehicle, motion)
    gear = track[int(progress[0]), GEAR]
    led = guided_axle(rig, pose, angle, gear)
    spot = locate(track, progress, led.x, led.y, motion.speed)
    if track[spot.point, GEAR] != gear:
        gear = track[spot.point, GEAR]
        led = guided_axle(rig, pose, angle, gear)
        spot = locate(track, progress, led.x, led.y, motion.speed)
    if gear > 0.0:
        pursuit = PURSUIT * (vehicle.front_axle + vehicle.rear_axle)
        curvature = pursue(track, spot, led.x, led.y, led.heading, motion.speed, pursuit)
        return drive_on(track, spot, vehicle, motion, curvature, 1.0, cap)
    curvature = _curvature_back(track, spot, rig, led, angle, motion.speed)
    planned = track[spot.point, ANGLE]
    ratio = max(way_behind(rig, planned, track[spot.point, CURVATURE]), LEAST_RATIO)
    return drive_on(track, spot, vehicle, motion, curvature, ratio, cap)
