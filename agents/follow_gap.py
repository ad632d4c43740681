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
YAW_RATE = PART_NUMBERS["yaw_rate"]
SPEED_CAP = PART_NUMBERS["speed_cap"]
GRIP_SCALE = PART_NUMBERS["grip_scale"]
# Directions further off than this [rad] are behind the shoulder.
SHOULDER = math.radians(80.0)
BESIDE = math.radians(60.0)
NARROW = math.radians(12.6)
DEEP_SHARE = 0.93
# An edge hides half-widths of so many body widths; it is a rise of so many body lengths.
HALF_WIDTHS, EDGE_LENGTHS = 0.85, 1.5
# Steers to a point in the gap so far away: body lengths, and time at the present speed [s].
LOOK_LENGTHS, LOOK_S = 1.5, 0.1
LEAD_S = 0.06  # the gap is where it will be seen so much later
ROOM, PUSH = 0.7, 0.1  # body widths beside the lidar; share of the tightest bend to get it
STOP_GAP = 0.3  # body lengths
# Of the grip. A bend is only begun at the curvature asked for, hence more than there is.
BEND_SHARE, BRAKE_SHARE, END_SHARE = 1.2, 0.6, 0.8


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
    rays, field, speed = at[-1], gear[FIELD], seen[at[SPEED]]
    free = KEPT + rays
    repair(seen, at[LIDAR], rays, gear[REACH], memory, KEPT)
    step = field / (rays - 1)
    half, jump = HALF_WIDTHS * vehicle.width, EDGE_LENGTHS * vehicle.length
    widen_edges(memory, KEPT, rays, step, half, jump, memory, free)
    depth = nearest_deepest(memory, free, rays, field)
    angle = middle_of_gap(memory, free, rays, field, DEEP_SHARE * depth)
    angle -= LEAD_S * seen[at[YAW_RATE]]
    look = min(LOOK_LENGTHS * vehicle.length + LOOK_S * max(speed, 0.0), depth)
    # The circle through a point at this distance and angle.
    bend = 2.0 * math.sin(angle) / max(look, 1e-3)
    bend = _keep_off_the_sides(memory, rays, field, gear[REACH], vehicle, bend)
    wheelbase = vehicle.front_axle + vehicle.rear_axle
    control[0] = math.atan(bend * wheelbase) / vehicle.steering_limit
    front = _front(memory, free, rays, field, angle, depth)
    target = _speed(vehicle, front, bend, seen[at[GRIP_SCALE]])
    press_pedals(speed, min(target, seen[at[SPEED_CAP]]), 2.5, control)
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
    ranges: Floats, rays: int, field: float, reach: float, vehicle: Record, bend: float
) -> float:
    """Return the curvature [1/m]: to the gap, but never into what is right beside."""
    tightest = math.tan(vehicle.steering_limit) / (vehicle.front_axle + vehicle.rear_axle)
    room = ROOM * vehicle.width
    left = nearest(ranges, KEPT, rays, field, BESIDE, math.pi, reach)
    right = nearest(ranges, KEPT, rays, field, -math.pi, -BESIDE, reach)
    if left < room:
        bend = min(bend, 0.0) - PUSH * tightest * (1.0 - left / room)
    if right < room:
        bend = max(bend, 0.0) + PUSH * tightest * (1.0 - right / room)
    return min(max(bend, -tightest), tightest)


@kernel
def _front(free: Floats, base: int, rays: int, field: float, angle: float, depth: float) -> float:
    """Return the way [m] that is free towards the gap; less where the nose points at a wall."""
    front = nearest(free, base, rays, field, angle - NARROW, angle + NARROW, depth)
    ahead = nearest(free, base, rays, field, -NARROW, NARROW, depth)
    return min(front, ahead + 0.5 * front)


@kernel
def _speed(vehicle: Record, front: float, bend: float, grip_scale: float) -> float:
    """Return the speed [m/s] that the free way `front` [m] and the bend [1/m] allow."""
    grip = vehicle.grip * GRAVITY * grip_scale
    wheelbase = vehicle.front_axle + vehicle.rear_axle
    way = max(front - STOP_GAP * vehicle.length, 0.0)
    # At the end of the free way there is room for the tightest bend, unless it is here already.
    end = END_SHARE * math.sqrt(grip * wheelbase / math.tan(vehicle.steering_limit))
    end = min(end, 0.5 * end + 2.0 * way)
    braking = BRAKE_SHARE * min(grip, vehicle.brake_force / vehicle.mass)
    target = math.sqrt(end * end + 2.0 * braking * way)
    return min(target, math.sqrt(BEND_SHARE * grip / max(abs(bend), 1e-3)), vehicle.top_speed)


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
