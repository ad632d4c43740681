"""Follow the gap: drive towards the deepest free direction that the body fits through.

Needs a lidar and nothing else. After Sezer and Gokasan (2012) and the disparity extender of
Otterness (2019).
"""

import math

from agents.scan import nearest, ray_angle, repair, widen_edges
from agents.tactics import SPEED, finish_decision, press_pedals
from race_server.autopilot import FIELD, KEPT, REACH, Autopilot
from race_server.kernels.jit import kernel
from race_server.observe import PART_NUMBERS
from race_server.params import GRAVITY
from race_server.state import Floats, Ints, Record, Records

LIDAR = PART_NUMBERS["lidar"]
# Directions further off than this [rad] are behind the shoulder.
SHOULDER = math.radians(80.0)
BESIDE = math.radians(60.0)
NARROW = math.radians(12.0)
DEEP_SHARE = 0.85


@kernel
def follow(
    seen: Floats,
    at: Ints,
    vehicle: Record,
    gear: Floats,
    kinds: Ints,
    memory: Floats,
    control: Floats,
) -> None:
    """Steer to the deepest gap; as fast as the kart can stop or turn in the free space ahead."""
    rays, field = at[-1], gear[FIELD]
    free = KEPT + rays
    repair(seen, at[LIDAR], rays, gear[REACH], memory, KEPT)
    step = field / (rays - 1)
    half, jump = 0.75 * vehicle.width, 0.5 * vehicle.length
    widen_edges(memory, KEPT, rays, step, half, jump, memory, free)
    depth = nearest_deepest(memory, free, rays, field)
    angle = middle_of_gap(memory, free, rays, field, DEEP_SHARE * depth)
    steering = _keep_off_the_sides(memory, rays, field, gear[REACH], vehicle, angle)
    control[0] = steering / vehicle.steering_limit
    target = _speed(memory, free, rays, field, vehicle, depth, steering)
    press_pedals(seen[at[SPEED]], target, 2.0, control)
    finish_decision(seen, at, vehicle, gear, kinds, memory, control)


@kernel
def nearest_deepest(free: Floats, base: int, rays: int, field: float) -> float:
    """Return the largest range [m] before the shoulders."""
    depth = 0.0
    for ray in range(rays):
        if abs(ray_angle(ray, rays, field)) <= SHOULDER:
            depth = max(depth, free[base + ray])
    return depth


@kernel
def middle_of_gap(free: Floats, base: int, rays: int, field: float, deep: float) -> float:
    """Return the direction [rad] of the widest stretch of rays that reach `deep` [m].

    Of two equally wide stretches the straighter one.
    """
    best_score, best_angle = -math.inf, 0.0
    begin = -1
    for ray in range(rays + 1):
        is_deep = (
            ray < rays and free[base + ray] >= deep and abs(ray_angle(ray, rays, field)) <= SHOULDER
        )
        if is_deep and begin < 0:
            begin = ray
        if not is_deep and begin >= 0:
            angle = ray_angle(0.5 * (begin + ray - 1), rays, field)
            score = ray - begin - 0.2 * abs(angle)
            if score > best_score:
                best_score, best_angle = score, angle
            begin = -1
    return best_angle


@kernel
def _keep_off_the_sides(
    ranges: Floats, rays: int, field: float, reach: float, vehicle: Record, angle: float
) -> float:
    """Return the steering angle [rad]: to the gap, but never into what is right beside."""
    limit, beside = vehicle.steering_limit, 0.9 * vehicle.width
    left = nearest(ranges, KEPT, rays, field, BESIDE, math.pi, reach)
    right = nearest(ranges, KEPT, rays, field, -math.pi, -BESIDE, reach)
    if left < beside:
        angle = min(angle, 0.0) - 0.5 * limit * (1.0 - left / beside)
    if right < beside:
        angle = max(angle, 0.0) + 0.5 * limit * (1.0 - right / beside)
    return min(max(angle, -limit), limit)


@kernel
def _speed(
    free: Floats,
    base: int,
    rays: int,
    field: float,
    vehicle: Record,
    depth: float,
    steering: float,
) -> float:
    """Return the speed [m/s] that the free space ahead and the bend allow."""
    front = nearest(free, base, rays, field, -NARROW, NARROW, depth)
    grip = vehicle.grip * GRAVITY
    stop = math.sqrt(grip * max(front - 0.6 * vehicle.length, 0.0))
    bend = math.tan(abs(steering)) / (vehicle.front_axle + vehicle.rear_axle)
    turn = math.sqrt(0.6 * grip / max(bend, 1e-3))
    return min(min(stop + 0.4, turn + 0.3 * depth), vehicle.top_speed)


@kernel
def follow_all(
    seats: Ints,
    seen: Floats,
    at: Ints,
    vehicles: Records,
    gear: Floats,
    kinds: Ints,
    memory: Floats,
    controls: Floats,
) -> None:
    """Decide for many karts: row n of `seats` is a world and a kart in it."""
    for row in range(len(seats)):
        w, k = seats[row, 0], seats[row, 1]
        follow(seen[w, k], at, vehicles[w, k], gear, kinds, memory[w, k], controls[w, k])


class FollowGap(Autopilot):
    """Steers to the deepest gap; as fast as it can stop or turn in the free space ahead."""

    preset = "lidar"
    decide = staticmethod(follow)
    decide_all = staticmethod(follow_all)
