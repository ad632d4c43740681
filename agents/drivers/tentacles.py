"""Driving with tentacles: 81 arcs for each of 16 speeds, judged by what the lidar sees along them.

After von Hundelshausen, Himmelsbach, Hecker, Mueller and Wuensche, Driving with Tentacles:
Integral Structures for Sensing and Motion, Journal of Field Robotics 25(9), 2008. A support area
wider than the car is searched along each arc; arcs that leave room to stop are drivable, and the
least weighted sum of clearance, flatness and trajectory wins. If none is drivable the longest is
taken, and the car brakes.

What differs here, and why:

- The paper reads a grid of cells, here there is one scan. Each point stands for the wall between
  two rays, range times angle [m]; that is its weight, so that near and far walls count alike.
- Flatness judged the roughness of the ground. In two dimensions the wall within the support area
  stands in for it: a way with less of it beside is the better one.
- There is no map and so no wanted path. The middle of the deepest gap stands in for it.
- Lengths are the paper's in the proportion of the wheelbases (its car: 2.855 m), so that the same
  code drives the 1/10 car and karts; radii also respect what the car can steer and hold.
"""

import math

from race_agents.drivers.tentacle_search import (
    ARCS,
    BENDS,
    CURVATURE,
    FIRST_BIN,
    FREE,
    LENGTH,
    SIDE,
    arc_length,
    find_nearest,
    free_along,
    place_points,
    slide_window,
    square_points,
    wall_along,
)
from race_agents.planning.driven_way import NONE, rays_across, remember_way, shut, wall_off
from race_agents.planning.gap_way import middle_of_gap, nearest_deepest
from race_agents.planning.scan import age_of_scan, fill_dropouts, widen_edges
from race_agents.planning.tactics import SPEED, finish_decision, press_pedals
from race_agents.planning.turn_back import SIDE as BACK_TO
from race_agents.planning.turn_back import has_turned_round
from race_server.core.kernel_driver import (
    DECISION,
    FIELD,
    KEPT,
    REACH,
    Cockpit,
    Cockpits,
    KernelDriver,
    cockpit_at,
)
from race_server.core.kernels.jit import kernel
from race_server.core.observation import PART_NUMBERS
from race_server.core.state import Floats, Record
from race_server.core.vehicle_presets import TENTH
from race_server.core.vehicles import GRAVITY

LIDAR = PART_NUMBERS["lidar"]
YAW_RATE = PART_NUMBERS["yaw_rate"]
STEERING = PART_NUMBERS["steering"]
SPEED_CAP = PART_NUMBERS["speed_cap"]
GRIP_SCALE = PART_NUMBERS["grip_scale"]

# The paper's figures; lengths [m] and speeds [m/s] of a car with WHEELBASE.
WHEELBASE = 2.855
CLASSES = 16
SHORTEST, LONGER = 8.0, 33.5
SLOWEST, FASTEST = 0.25, 10.0
SPEED_POWER, RADIUS_POWER = 1.2, 0.9
WIDEST = 0.6 * math.pi  # [rad] that the sharpest arc of the slowest class turns

SAFE_GAP = 0.8  # body lengths to keep when stopping in front of something
SAFE_BRAKING = 3.0  # [m/s²]
HALF_CLEAR = 10.0  # body lengths of free way at which the clearance is half of the worst
CLEARANCE, FLATNESS, TRAJECTORY, CHANGE = 1.0, 0.6, 0.2, 0.08
# The wanted direction: edges hide what a body of half-width GAP_HALF [widths] cannot reach.
GAP_HALF, GAP_JUMP, GAP_DEEP = 0.4, 0.5, 0.9

# What is decided now has its effect so much later. In truth 0.1 s; counting less brakes and turns
# earlier, which costs 2 % of lap time and saved every touch of a wall.
LEAD_S = 0.05
BEND_SHARE, BRAKE_SHARE, END_SHARE = 0.75, 0.6, 0.65
STOP_GAP = 0.7  # body lengths
BACK_SPEED = 3.5  # body lengths a second at most while it turns back


@kernel
def speed_class(speed: float) -> int:
    """Return the class 0 to 15 whose speed v_s + q^1.2 (v_e - v_s) is nearest below or at it."""
    share = min(max((speed - SLOWEST) / (FASTEST - SLOWEST), 0.0), 1.0)
    return min(int(share ** (1.0 / SPEED_POWER) * (CLASSES - 1) + 0.5), CLASSES - 2)


@kernel
def class_length(number: int, scale: float) -> float:
    """Return the length [m] of the sharpest arc of a class."""
    q = number / (CLASSES - 1)
    return scale * (SHORTEST + LONGER * q**SPEED_POWER)


@kernel
def class_radius(number: int, scale: float) -> float:
    """Return the radius [m] of the sharpest arc of a class below the last, which is straight."""
    q = number / (CLASSES - 1)
    return class_length(number, scale) / (WIDEST * (1.0 - q**RADIUS_POWER))


@kernel
def stopping_length(speed: float, length: float) -> float:
    """Return the free length l_c = l_s + v²/2a [m] that makes an arc drivable."""
    return SAFE_GAP * length + speed * speed / (2.0 * SAFE_BRAKING)


@kernel
def clearance_of(free: float, length: float, body: float) -> float:
    """Return how bad an arc's free length [m] is: 0 for free to its end, towards 1 for none."""
    if free >= length:
        return 0.0
    steepness = math.log(3.0) / (HALF_CLEAR * body)
    return 2.0 - 2.0 / (1.0 + math.exp(-steepness * free))


@kernel
def flatness_of(wall: float, body: float) -> float:
    """Return how bad the wall [m] in an arc's support area is, 0 to 1."""
    return 2.0 / (1.0 + math.exp(-wall / body)) - 1.0


@kernel
def direction_after(curvature: float, length: float) -> float:
    """Return the direction [rad] in which an arc's end lies: half of what it turns."""
    return 0.5 * curvature * length


@kernel
def least_turn(curvature: float, free: float, goal: float) -> float:
    """Return how near to a direction [rad] an arc comes that is free for a length [m] at most."""
    end = direction_after(curvature, free)
    return abs(goal - min(max(goal, min(end, 0.0)), max(end, 0.0)))


@kernel
def most_wall(slack: float, body: float) -> float:
    """Return the wall [m] whose flatness adds `slack` to the value of an arc."""
    share = slack / FLATNESS
    return body * math.log((1.0 + share) / (1.0 - share)) if share < 1.0 else math.inf


@kernel
def least_of(memory: Floats, first: int, count: int) -> int:
    """Return the place of the least of `count` numbers from `first` on, the first of equal ones."""
    found = 0
    for place in range(1, count):
        if memory[first + place] < memory[first + found]:
            found = place
    return found


@kernel
def choose_arc(
    memory: Floats, rays: int, step: float, speed: float, now: float, goal: float, vehicle: Record
) -> bool:
    """Write curvature, length and free length of the best arc; return whether it is drivable.

    now: the curvature that the wheels are turned to [1/m]; goal: the wanted direction [rad].

    Walls beside an arc are only looked for while it may still be the best: what its free length
    alone makes it worth is its value at best, and arcs are taken in the order of that.
    """
    out = KEPT + 4 * rays
    bends = out + BENDS
    # In place of what `find_nearest` finds.
    bounds, frees = bends + ARCS, bends + 2 * ARCS
    wheelbase, body = vehicle.front_axle + vehicle.rear_axle, vehicle.length
    tightest = wheelbase / math.tan(vehicle.steering_limit)
    scale = wheelbase / WHEELBASE
    number = speed_class(speed)
    start = class_length(number, scale)
    sharpest = max(class_radius(number, scale), tightest, speed * speed / (vehicle.grip * GRAVITY))
    needed = stopping_length(speed, body)
    find_nearest(memory, rays, sharpest, vehicle)
    for arc in range(ARCS):
        curvature, length = memory[bends + arc], arc_length(arc, start, scale)
        along, aside = memory[bounds + arc], memory[frees + arc]
        free = free_along(abs(curvature), along, aside, length, 0.5 * body)
        value = CLEARANCE * clearance_of(free, length, body)
        value += TRAJECTORY * least_turn(curvature, free, goal)
        value += CHANGE * abs(curvature - now) * tightest
        memory[bounds + arc] = value if free >= min(needed, length) else math.inf
        memory[frees + arc] = -free
    best, chosen = math.inf, -1
    for _ in range(ARCS):
        arc = least_of(memory, bounds, ARCS)
        bound = memory[bounds + arc]
        if bound == math.inf or bound > best:
            break
        memory[bounds + arc] = math.inf
        curvature, length = memory[bends + arc], arc_length(arc, start, scale)
        side = 1.0 if arc <= SIDE else -1.0
        # A little more than that would do: sums are rounded.
        most = most_wall(best - bound + 1e-9, body)
        wall = wall_along(memory, rays, step, side, abs(curvature), length, most, vehicle)
        if wall > most:
            continue
        share = slide_window(memory, out + FIRST_BIN, vehicle.width)
        clear = min(-memory[frees + arc], share * length)
        value = CLEARANCE * clearance_of(clear, length, body)
        value += FLATNESS * flatness_of(wall, body)
        value += TRAJECTORY * abs(direction_after(curvature, clear) - goal)
        value += CHANGE * abs(curvature - now) * tightest
        if value < best or (value == best and arc < chosen):
            best, chosen = value, arc
    drivable = chosen >= 0
    if not drivable:
        chosen = least_of(memory, frees, ARCS)
    memory[out + FREE] = -memory[frees + chosen]
    memory[out + LENGTH] = arc_length(chosen, start, scale)
    memory[out + CURVATURE] = memory[bends + chosen]
    return drivable


@kernel
def feel(cockpit: Cockpit) -> None:
    """Take the best arc, as fast as the free way along it and its bend allow."""
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, setup = cockpit.vehicle, cockpit.setup
    memory, control = cockpit.memory, cockpit.control
    rays, field, speed = offsets[-1], setup[FIELD], max(observation[offsets[SPEED]], 0.0)
    step, widened = field / (rays - 1), KEPT + rays
    wheelbase = vehicle.front_axle + vehicle.rear_axle
    fill_dropouts(observation, offsets[LIDAR], rays, setup[REACH], memory, KEPT)
    later = LEAD_S + age_of_scan(observation, offsets[LIDAR], rays, setup[DECISION], memory)
    turn = later * observation[offsets[YAW_RATE]]
    place_points(memory, rays, field, later * speed, turn)
    has_turned = has_turned_round(cockpit, rays)
    remember_way(cockpit)
    across = rays_across(memory, rays, field, vehicle.length)
    if across[0] != NONE:
        wall_off(memory, rays, field, vehicle.length)
        place_points(memory, rays, field, later * speed, turn)
    half, jump = GAP_HALF * vehicle.width, GAP_JUMP * vehicle.length
    widen_edges(memory, KEPT, rays, step, half, jump, memory, widened)
    shut(memory, widened, across)
    depth = nearest_deepest(memory, widened, rays, field)
    goal = middle_of_gap(memory, widened, rays, field, GAP_DEEP * depth)
    square_points(memory, rays)
    now = math.tan(observation[offsets[STEERING]]) / wheelbase
    drivable = choose_arc(memory, rays, step, speed, now, goal - turn, vehicle)
    control[0] = math.atan(memory[KEPT + 4 * rays + CURVATURE] * wheelbase) / vehicle.steering_limit
    target = _speed(
        memory, KEPT + 4 * rays, vehicle, observation[offsets[GRIP_SCALE]], depth, drivable
    )
    if has_turned:
        control[0], target = memory[BACK_TO], min(target, BACK_SPEED * vehicle.length)
    press_pedals(
        observation[offsets[SPEED]], min(target, observation[offsets[SPEED_CAP]]), 2.7, control
    )
    control[2] = min(1.2 * control[2], 1.0)  # the brake is what saves a bend taken too fast
    finish_decision(cockpit)


@kernel
def _speed(
    memory: Floats, found: int, vehicle: Record, grip_scale: float, depth: float, drivable: bool
) -> float:
    """Return the speed [m/s] for the bend and for the way that is free; less if nothing is."""
    grip = vehicle.grip * GRAVITY * grip_scale
    free, bend = memory[found + FREE], abs(memory[found + CURVATURE])
    if free >= memory[found + LENGTH]:
        free = max(free, depth)  # an arc ends, the view goes on
    wheelbase = vehicle.front_axle + vehicle.rear_axle
    way = max(free - STOP_GAP * vehicle.length, 0.0)
    # At the end of the free way there is room for the tightest bend, unless it is here already.
    end = END_SHARE * math.sqrt(grip * wheelbase / math.tan(vehicle.steering_limit))
    end = min(end, 0.5 * end + 2.0 * way)
    braking = BRAKE_SHARE * min(grip, vehicle.brake_force / vehicle.mass)
    target = math.sqrt(end * end + 2.0 * braking * way)
    target = min(target, math.sqrt(BEND_SHARE * grip / max(bend, 1e-3)), vehicle.top_speed)
    return target if drivable else min(target, end)


@kernel
def feel_all(cockpits: Cockpits) -> None:
    """Decide for many karts in one call."""
    for row in range(len(cockpits.seats)):
        feel(cockpit_at(cockpits, row))


class Tentacles(KernelDriver):
    """Judges 81 arcs by what the lidar sees along them and takes the best."""

    preset = "lidar"
    vehicles = TENTH  # takes the end of a kart's view, four of its lengths, for a wall
    decide = staticmethod(feel)
    decide_all = staticmethod(feel_all)
