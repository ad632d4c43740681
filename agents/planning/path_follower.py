"""Drives a vehicle along a path of arcs, forward and back, and stops at its end.

A path is made ready once: legs between changes of direction, and along each the curvature, spread
so that the wheels can turn while the vehicle drives, and the speed at which they have the time.
Steering is pure pursuit of the rear axle, seen from the path: towards a point `PURSUIT` ahead on an
arc, whose curvature for small errors is that of the path - 2 offset / PURSUIT² - 2 turn / PURSUIT.
At the end of a leg the vehicle stands until its wheels have turned.
"""

import math
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from race_agents.planning.path import Path, path_of
from race_server.core.kernels.geometry import Pose, clip, cos_sin, wrap_angle
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.motion import Command, Motion
from race_server.core.state import Floats, Record
from race_server.core.vehicles import GRAVITY, Vehicle
from race_server.errors import PlanError

# Way between two points of a leg [m], and the way over which a change of curvature is spread [m]:
# it moves the path by curvature · SPREAD² / 24, 7 mm from full lock to full lock of a car.
SPACING, SPREAD = 0.05, 0.5
# Distance of the point that is pursued [m].
PURSUIT = 1.0
# Shares of what motor, brakes, steering and tyres can do; the rest is left to corrections.
PACE_SHARE, BRAKE_SHARE, TURN_SHARE, GRIP_SHARE = 0.7, 0.5, 0.7, 0.3
# How far ahead [s] the path's curvature is followed.
LEAD_S = 0.1
# At the end of a leg [s]: a vehicle that decides ten times a second stops there to a centimetre.
APPROACH_S = 0.3
# A vehicle keeps to this share of a speed that it must not exceed.
CAP_SHARE = 0.9
# Gain of the speed error [1/s].
SPEED_GAIN = 4.0
# Slowest speed on a path [m/s], until this way is left [m].
CREEP, ARRIVED = 0.06, 0.005
# The vehicle stands below this speed [m/s]; wheels have turned when this near to their angle [rad]:
# with 2° of play they come no nearer than half of that. With more than 3.4° a vehicle stands: tried
# without this, 10 of 30 cars with 5° of play hit what they pass by 5 cm.
STANDING, TURNED = 0.01, 0.03

# Columns of a track; LEFT: way to the end of the leg [m], LAST: number of its last point, ANGLE: at
# the hitch [rad], 0 without a trailer.
X, Y, HEADING, CURVATURE, SPEED, GEAR, LEFT, LAST, ANGLE = range(9)
COLUMNS = 9


class Spot(NamedTuple):
    """Where on a track a vehicle is."""

    point: int  # number of the point passed last
    share: float  # of the step from there to the next point
    step: float  # [m]
    arrived: bool  # at the end of the leg


def make_track(path: Path, vehicle: Vehicle, cruise: float) -> Floats:
    """Return a path made ready for a vehicle: (S, COLUMNS), one leg after the other.

    cruise: most speed [m/s], which the vehicle's limits may lower.

    Raises:
        PlanError: the path has no arcs.
    """
    if len(path.arcs) == 0:
        raise PlanError("a path without arcs cannot be followed: the vehicle is at its goal")
    ways = path.arcs[:, 1]
    changes = np.diff(np.sign(ways)) != 0.0
    # On an arc that is too short to spread a change of curvature the wheels turn at a stand.
    changes |= np.minimum(np.abs(ways[1:]), np.abs(ways[:-1])) < SPREAD
    cuts = [0, *(np.flatnonzero(changes) + 1).tolist(), len(ways)]
    legs: list[Floats] = []
    start = path.start
    for first, after in pairwise(cuts):
        part = path_of(start, path.arcs[first:after])
        last = sum(len(leg) for leg in legs)
        legs.append(_leg(part, vehicle, cruise, last))
        start = Pose(*(float(value) for value in part.poses[-1]))
    return np.concatenate(legs)


def _leg(part: Path, vehicle: Vehicle, cruise: float, first: int) -> Floats:
    """Return the points of a path in one direction; first: number of its first point."""
    samples = part.sampled(SPACING)
    ways = np.abs(samples.ways)
    gear = float(np.sign(samples.ways[0]))
    driven = np.concatenate([[0.0], np.cumsum(ways)])
    curvatures = _spread(driven, samples.curvatures)
    # What the spread curvature turns, without what rounding and the ends of the leg add to it.
    turned = np.concatenate(
        [[0.0], np.cumsum(0.5 * (curvatures[1:] + curvatures[:-1]) * samples.ways)]
    )
    error = turned[-1] - (samples.poses[-1, 2] - samples.poses[0, 2])
    leg = np.zeros((len(driven), COLUMNS))
    leg[:, :2] = samples.poses[:, :2]
    leg[:, HEADING] = samples.poses[0, 2] + turned - error * driven / driven[-1]
    leg[:, CURVATURE] = curvatures
    limits = speed_limits(curvatures, ways, gear, vehicle, cruise)
    leg[:, SPEED] = paced(limits, ways, vehicle)
    leg[:, GEAR], leg[:, LEFT], leg[:, LAST] = gear, driven[-1] - driven, first + len(leg) - 1
    return leg


def speed_limits(
    curvatures: Floats, ways: Floats, gear: float, vehicle: Vehicle, cruise: float
) -> Floats:
    """Return how fast [m/s] a vehicle may drive between the points of a leg, (S,).

    curvatures: (S + 1,) [1/m] at the points; ways: (S,) [m]; gear: 1 ahead, -1 in reverse; cruise:
    [m/s].
    """
    angles = np.arctan(curvatures * vehicle.wheelbase)
    most = min(cruise, vehicle.top_speed if gear > 0.0 else vehicle.reverse_speed)
    turning = np.abs(np.diff(angles)) / ways
    limits = np.minimum(most, TURN_SHARE * vehicle.steering_rate / np.maximum(turning, 1e-9))
    bends = np.maximum(np.abs(curvatures[1:]), np.abs(curvatures[:-1]))
    grip = GRIP_SHARE * vehicle.grip * GRAVITY
    return np.minimum(limits, np.sqrt(grip / np.maximum(bends, 1e-9)))


def _spread(driven: Floats, curvatures: Floats) -> Floats:
    """Return the mean curvature [1/m] within half of SPREAD of each point.

    driven: (S + 1,) [m] at the points; curvatures: (S,) [1/m] between them. Near the ends the
    window is smaller, so that a leg begins and ends with the curvature of its arcs.
    """
    integral = np.concatenate([[0.0], np.cumsum(curvatures * np.diff(driven))])
    half = np.minimum(0.5 * SPREAD, np.minimum(driven, driven[-1] - driven))
    half = np.maximum(half, 1e-6)
    low, high = np.maximum(driven - half, 0.0), np.minimum(driven + half, driven[-1])
    return (np.interp(high, driven, integral) - np.interp(low, driven, integral)) / (high - low)


def paced(limits: Floats, ways: Floats, vehicle: Vehicle) -> Floats:
    """Return speeds [m/s] at the points of a leg that begins and ends at a stand.

    limits: (S,) [m/s] between the points; ways: (S,) [m].
    """
    speeds = np.minimum(np.append(limits, np.inf), np.insert(limits, 0, np.inf))
    speeds[0] = speeds[-1] = 0.0
    resting = vehicle.rolling * GRAVITY
    pace = PACE_SHARE * (vehicle.motor_force / vehicle.mass - resting)
    brakes = BRAKE_SHARE * (vehicle.brake_force / vehicle.mass + resting)
    for k, way in enumerate(ways):
        speeds[k + 1] = min(speeds[k + 1], math.sqrt(speeds[k] ** 2 + 2.0 * pace * way))
    left = 0.0
    for k in range(len(ways) - 1, -1, -1):
        left += ways[k]
        speeds[k] = min(speeds[k], math.sqrt(speeds[k + 1] ** 2 + 2.0 * brakes * ways[k]))
        speeds[k] = min(speeds[k], CREEP + left / APPROACH_S)
    return speeds


@kernel
def _ahead_of(track: Floats, point: int, x: float, y: float) -> float:
    """Return how far [m] a place lies beyond a point, in the direction of travel."""
    cos, sin = cos_sin(track[point, HEADING])
    return track[point, GEAR] * ((x - track[point, X]) * cos + (y - track[point, Y]) * sin)


@kernel
def _pedals(
    vehicle: Record, speed: float, wanted: float, pace: float, gear: float
) -> tuple[float, float]:
    """Return throttle and brake for a wanted speed [m/s], which is never against the gear.

    pace: rate [m/s²] at which the wanted speed grows in the direction of travel.
    """
    if pace < 0.0:
        # A slower vehicle stops at the same place with softer brakes.
        share = clip(speed / wanted, 0.0, 1.0)
        pace *= share * share
    rate = pace + SPEED_GAIN * gear * (wanted - speed) + vehicle.rolling * GRAVITY
    force = vehicle.mass * rate
    if force >= 0.0:
        return gear * min(force / vehicle.motor_force, 1.0), 0.0
    return 0.0, min(-force / vehicle.brake_force, 1.0)


@kernel
def _point_passed(track: Floats, point: int, x: float, y: float) -> int:
    """Return the last point of the leg, but its end, that a place has passed."""
    last = int(track[point, LAST])
    while point + 1 < last and _ahead_of(track, point + 1, x, y) >= 0.0:
        point += 1
    return point


@kernel
def locate(track: Floats, progress: Floats, x: float, y: float, speed: float) -> Spot:
    """Return where on a track an axle at (x, y) [m] is; a vehicle at a stand begins the next leg.

    progress: (1,) number of the point that was passed last, moved on here; speed: [m/s].
    """
    point = _point_passed(track, int(progress[0]), x, y)
    last = int(track[point, LAST])
    arrived = track[point, LEFT] - _ahead_of(track, point, x, y) <= ARRIVED
    if arrived and abs(speed) < STANDING and last + 1 < len(track):
        point, arrived = last + 1, False
    progress[0] = point
    step = track[point, LEFT] - track[point + 1, LEFT]
    share = clip(_ahead_of(track, point, x, y) / step, 0.0, 1.0)
    return Spot(point, share, step, arrived)


@kernel
def leading_point(track: Floats, spot: Spot, speed: float) -> int:
    """Return the number of a point ahead whose curvature is followed: wheels need time."""
    lead = spot.point + int(spot.share + abs(speed) * LEAD_S / spot.step)
    return min(lead, int(track[spot.point, LAST]))


@kernel
def pursue(
    track: Floats, spot: Spot, x: float, y: float, heading: float, speed: float, pursuit: float
) -> float:
    """Return the curvature [1/m] that leads an axle back to its track.

    x, y, heading: of the axle; speed: [m/s]; pursuit: how far ahead the point is that is pursued
    [m].
    """
    point, gear = spot.point, track[spot.point, GEAR]
    # From the path to the rear axle; the path bends between two points.
    curvature, way = track[point, CURVATURE], gear * spot.share * spot.step
    cos, sin = cos_sin(wrap_angle(track[point, HEADING]))
    offset = (y - track[point, Y]) * cos - (x - track[point, X]) * sin - 0.5 * curvature * way * way
    turn = wrap_angle(heading - track[point, HEADING] - curvature * way)
    curvature = track[leading_point(track, spot, speed), CURVATURE]
    return curvature - (2.0 * offset / (pursuit * pursuit) + 2.0 * gear * turn / pursuit)


@kernel
def drive_on(
    track: Floats,
    spot: Spot,
    vehicle: Record,
    motion: Motion,
    curvature: float,
    ratio: float,
    cap: float,
) -> Command:
    """Return what to do at a spot of a track: steer, and drive, stop or stand.

    curvature: wanted of the rear axle [1/m]; ratio: way of the axle that the track is of, on a
    metre of the vehicle; cap: most speed [m/s], above it all brakes act.
    """
    point, gear = spot.point, track[spot.point, GEAR]
    stands = abs(motion.speed) < STANDING
    angle = math.atan(curvature * (vehicle.front_axle + vehicle.rear_axle))
    angle = clip(angle, -vehicle.steering_limit, vehicle.steering_limit)
    steering = angle / vehicle.steering_limit

    begins = point == 0 or track[point - 1, LEFT] <= 0.0
    if (
        spot.arrived
        or cap <= abs(motion.speed)
        or (begins and stands and abs(motion.steering - angle) > TURNED)
    ):
        return Command(steering, 0.0, 1.0)
    speed, after = track[point, SPEED], track[point + 1, SPEED]
    wanted = (speed + spot.share * (after - speed)) / ratio
    pace = (after * after - speed * speed) / (2.0 * spot.step) / ratio
    if wanted < CREEP:
        wanted, pace = CREEP, 0.0
    # As fast as the cap no brakes would be left to be slow enough.
    if wanted > CAP_SHARE * cap:
        wanted, pace = CAP_SHARE * cap, min(pace, 0.0)
    throttle, brake = _pedals(vehicle, motion.speed, gear * wanted, pace, gear)
    return Command(steering, throttle, brake)


@large_kernel
def follow(track: Floats, progress: Floats, vehicle: Record, motion: Motion, cap: float) -> Command:
    """Return what to do now to stay on a track; at its end the brakes hold.

    track: (S, COLUMNS); progress: (1,) number of the point that was passed last, moved on here;
    vehicle: VEHICLE; motion: of the centre of gravity; cap: most speed [m/s], above it all brakes
    act.
    """
    cos, sin = cos_sin(wrap_angle(motion.heading))
    x, y = motion.x - vehicle.rear_axle * cos, motion.y - vehicle.rear_axle * sin
    spot = locate(track, progress, x, y, motion.speed)
    curvature = pursue(track, spot, x, y, motion.heading, motion.speed, PURSUIT)
    return drive_on(track, spot, vehicle, motion, curvature, 1.0, cap)
