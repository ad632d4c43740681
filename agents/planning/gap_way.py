"""The way through the opening that a scan tells of, on the path of least bending.

Where the scan jumps most, a near edge hides where the way goes on: that is the gap, after Sezer and
Gokasan (2012) and the disparity extender of Otterness (2019). Without an edge it is the middle of
the deepest free directions. The walls on both sides of it make a corridor, in whose frame a path is
planned as far as one can see; its bends and its end, behind which nothing is known, say how fast.
Two things are kept from one scan to the next: the way driven, across which no way goes on, and a
turn round nothing: that leads back, and the car turns again.
"""

import math

from race_agents.planning.corridor import Walls, find_gates, largest_edge
from race_agents.planning.driven_way import moved_in, rays_across, remember_way, shut, wall_off
from race_agents.planning.latency import LATENCY, THIRDS, estimate_latency
from race_agents.planning.path_smoothing import point_along, smooth_path, speed_before
from race_agents.planning.scan import (
    age_of_scan,
    fill_dropouts,
    move_scan,
    ray_angle,
    smooth_walls,
    widen_edges,
)
from race_agents.planning.tactics import SPEED
from race_agents.planning.turn_back import SIDE, has_turned_round
from race_server.core.kernel_driver import DECISION, FIELD, KEPT, REACH, Cockpit
from race_server.core.kernels.jit import kernel
from race_server.core.observation import PART_NUMBERS
from race_server.core.state import Floats, Record
from race_server.core.vehicles import GRAVITY

LIDAR = PART_NUMBERS["lidar"]
LATERAL_SPEED = PART_NUMBERS["lateral_speed"]
YAW_RATE = PART_NUMBERS["yaw_rate"]
GRIP_SCALE = PART_NUMBERS["grip_scale"]
# Directions further off than this [rad] are behind the shoulder.
SHOULDER = math.radians(80.0)
# Without an edge: directions that reach this share of the deepest one. An edge then hides what lies
# HALF_WIDTHS body widths beside it; it is a rise of EDGE_LENGTHS body lengths, here and elsewhere.
DEEP_SHARE, HALF_WIDTHS, EDGE_LENGTHS = 0.96, 0.7, 0.45
# Of the scan [m ahead of the middle], and how much later [s] a decision has half of its effect.
MOUNT, LEAD_S = 0.07, 0.05
# Gates, in body widths: distance between two, least width, distance of the path from their ends.
SPACING, NARROW, MARGIN = 2.2, 1.65, 1.3
HIDDEN_RADIUS = 0.95  # of the tightest bend
MOST_MOVE = 0.5  # body widths that a point of the path moves in a round
# Steers to a point of the path so far away: body lengths, and time at the present speed [s].
LOOK_LENGTHS, LOOK_S = 0.34, 0.16
# Of the grip: in the bends of the path; in the bend steered, which is only begun; of the brakes.
BEND_SHARE, STEER_SHARE, BRAKE_SHARE = 0.85, 1.2, 0.8
# Of the speed in the tightest bend: at the end of what is seen, where there is no path, and where
# it turns back.
END_SHARE, BLIND_SHARE, BACK_SHARE = 1.0, 0.5, 0.8
GAIN = 3.0  # of the pedals of those that drive by it [s/m]


@kernel
def find_way(cockpit: Cockpit) -> tuple[float, float]:
    """Return the curvature [1/m] to steer through the gap, and the speed [m/s] that it allows.

    That is as fast as its bends, and what is seen of it, let a vehicle drive.
    """
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, setup, memory = cockpit.vehicle, cockpit.setup, cockpit.memory
    rays, field, speed = offsets[-1], setup[FIELD], max(observation[offsets[SPEED]], 0.0)
    path = KEPT + 4 * rays
    fill_dropouts(observation, offsets[LIDAR], rays, setup[REACH], memory, KEPT)
    smooth_walls(memory, KEPT, rays, EDGE_LENGTHS * vehicle.length)
    remember_way(cockpit)
    split, hides = find_gap(memory, rays, field, vehicle)
    estimate_latency(cockpit)
    later = LEAD_S + memory[LATENCY] * setup[DECISION] / THIRDS
    later += age_of_scan(observation, offsets[LIDAR], rays, setup[DECISION], memory)
    gap = ray_angle(split, rays, field) - later * observation[offsets[YAW_RATE]]
    look_ahead(cockpit, rays, field, later)
    wheelbase, width = vehicle.front_axle + vehicle.rear_axle, vehicle.width
    tightest = wheelbase / math.tan(vehicle.steering_limit)
    look = LOOK_LENGTHS * vehicle.length + LOOK_S * speed
    grip = vehicle.grip * GRAVITY * observation[offsets[GRIP_SCALE]]
    slow = math.sqrt(grip * tightest)
    has_turned = has_turned_round(cockpit, rays)
    wall_off(memory, rays, field, vehicle.length)
    walls = Walls(memory, rays, split, hides, HIDDEN_RADIUS * tightest)
    begin = 0.5 * vehicle.length
    gates, closed = find_gates(walls, path, SPACING * width, NARROW * width, begin)
    if has_turned:
        bend, target = memory[SIDE] / tightest, BACK_SHARE * slow
    elif gates < 2:
        bend, target = 2.0 * math.sin(gap) / look, BLIND_SHARE * slow
    else:
        drift = math.atan2(observation[offsets[LATERAL_SPEED]], max(speed, 1.0))
        smooth_path(memory, path, gates, drift, width, MARGIN * width, MOST_MOVE * width)
        x, y = point_along(memory, path, gates, look)
        bend = bend_to(x, y, drift)
        end = 0.0 if closed else END_SHARE * slow
        braking = BRAKE_SHARE * min(grip, vehicle.brake_force / vehicle.mass)
        target = speed_before(memory, path, gates, end, grip, BEND_SHARE, braking)
    steered = min(max(abs(bend), 1e-3), 1.0 / tightest)
    target = min(target, math.sqrt(STEER_SHARE * grip / steered), vehicle.top_speed)
    return bend, target


@kernel
def find_gap(memory: Floats, rays: int, field: float, vehicle: Record) -> tuple[int, float]:
    """Return the last ray of the right wall, and the side of the edge that hides the way on.

    The side is 1 for left, -1 for right, 0 where no edge hides anything.
    """
    jump = EDGE_LENGTHS * vehicle.length
    across = rays_across(memory, rays, field, vehicle.length)
    edge = largest_edge(memory, KEPT, rays, field, jump, across)
    if edge >= 0:
        return edge, 1.0 if memory[KEPT + edge] > memory[KEPT + edge + 1] else -1.0
    free, half = KEPT + rays, HALF_WIDTHS * vehicle.width
    widen_edges(memory, KEPT, rays, field / (rays - 1), half, jump, memory, free)
    shut(memory, free, across)
    depth = nearest_deepest(memory, free, rays, field)
    angle = middle_of_gap(memory, free, rays, field, DEEP_SHARE * depth)
    ray = int((angle / field + 0.5) * (rays - 1))
    return min(max(ray, 1), rays - 3), 0.0


@kernel
def look_ahead(cockpit: Cockpit, rays: int, field: float, later: float) -> None:
    """Write the scan's points as seen from where the kart will be `later` [s]."""
    observation, offsets, memory = cockpit.observation, cockpit.offsets, cockpit.memory
    dx, dy, turn = moved_in(observation, offsets, max(observation[offsets[SPEED]], 0.0), later)
    move_scan(memory, rays, field, dx - MOUNT, dy, turn)


@kernel
def bend_to(x: float, y: float, drift: float) -> float:
    """Return the curvature [1/m] of the circle to a point, begun in the direction `drift` [rad]."""
    aside = y * math.cos(drift) - x * math.sin(drift)
    return 2.0 * aside / max(x * x + y * y, 1e-3)


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
