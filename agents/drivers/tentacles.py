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

from race_agents.drivers.follow_gap import middle_of_gap, nearest_deepest
from race_agents.planning.scan import age_of_scan, fill_dropouts, move_scan, widen_edges
from race_agents.planning.tactics import SPEED, finish_decision, press_pedals
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
CLASSES, SIDE = 16, 40  # speed classes; arcs on either side of the straight one
ARCS = 2 * SIDE + 1
SHORTEST, LONGER, EXTRA = 8.0, 33.5, 20.0
SLOWEST, FASTEST = 0.25, 10.0
SPEED_POWER, RADIUS_POWER = 1.2, 0.9
WIDEST = 0.6 * math.pi  # [rad] that the sharpest arc of the slowest class turns
GROWTH = 1.15  # of the radius from one arc to the next

# Half-widths of the classification and of the support area [body widths].
CORE, SUPPORT = 0.6, 2.0
BINS, WINDOW = 40, 3
ENOUGH_WALL = 0.15  # body widths of wall within a window that make an obstacle
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
# What is found about an arc, by place in the row of numbers to work with.
FREE, LENGTH, CURVATURE, FIRST_BIN = range(4)
BENDS = FIRST_BIN + BINS  # numbers of each arc


@kernel
def grown(factor: float, times: int) -> float:
    """Return `factor` to the power of a whole number, to the same bits compiled or not."""
    result = 1.0
    for _ in range(times):
        result *= factor
    return result


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
def arc_curvature(arc: int, sharpest: float) -> float:
    """Return the curvature [1/m] of an arc, from hard left to straight to hard right.

    sharpest: radius of the first and the last [m].
    """
    if arc == SIDE:
        return 0.0
    bend = 1.0 / (sharpest * grown(GROWTH, min(arc, 2 * SIDE - arc)))
    return bend if arc < SIDE else -bend


@kernel
def arc_length(arc: int, start: float, scale: float) -> float:
    """Return the length [m] of an arc. start: that of the sharpest [m]."""
    return start + scale * EXTRA * math.sqrt(min(arc, 2 * SIDE - arc) / SIDE)


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
def place_points(memory: Floats, rays: int, field: float, ahead: float, turn: float) -> None:
    """Write the scan's points as seen from where the car will be: x ahead, then y to the left.

    It will have driven `ahead` [m] and turned by `turn` [rad]. Their squared distances [m²] go
    where the widened scan was: all arcs are searched by them.
    """
    dx, dy = ahead * math.cos(0.5 * turn), ahead * math.sin(0.5 * turn)
    move_scan(memory, rays, field, dx, dy, turn)
    for ray in range(rays):
        x, y = memory[KEPT + 2 * rays + ray], memory[KEPT + 3 * rays + ray]
        memory[KEPT + rays + ray] = x * x + y * y


@kernel
def find_nearest(memory: Floats, rays: int, sharpest: float, vehicle: Record) -> None:
    """Write the curvatures of all arcs, and the first point that each meets, seen along it.

    With the curvature κ a point (x, y) is seen at (1 - κ y, x): its place along the arc is
    atan2(|κ| x, 1 - κ y) / |κ|, so that of two points the one clockwise of the other is first.

    A point lies within a body's half-width c of an arc where y - c < κ (x² + y² - c²) / 2 < y + c,
    hence of arcs that are neighbours: from one point to the next they are about the same.
    """
    core = CORE * vehicle.width
    squares, xs, ys = KEPT + rays, KEPT + 2 * rays, KEPT + 3 * rays
    bends = KEPT + 4 * rays + BENDS
    ahead, aside = bends + ARCS, bends + 2 * ARCS
    for arc in range(ARCS):
        memory[bends + arc] = arc_curvature(arc, sharpest)
        memory[ahead + arc], memory[aside + arc] = -1.0, 0.0  # behind: none yet
    first = 0
    for ray in range(rays):
        x, y = memory[xs + ray], memory[ys + ray]
        if x < 0.0:
            continue
        turn = 0.5 * (memory[squares + ray] - core * core)
        low, high = y - core, y + core
        if turn < 0.0:
            turn, low, high = -turn, -high, -low
        while first > 0 and memory[bends + first - 1] * turn < high:
            first -= 1
        while first < ARCS and memory[bends + first] * turn >= high:
            first += 1
        for arc in range(first, ARCS):
            bend = memory[bends + arc]
            if bend * turn <= low:
                break
            along = 1.0 - bend * y
            if along * memory[aside + arc] > x * memory[ahead + arc]:
                memory[ahead + arc], memory[aside + arc] = along, x


@kernel
def free_along(bend: float, along: float, aside: float, length: float, half: float) -> float:
    """Return how much of an arc is free [m], up to the point that it meets first.

    bend: its curvature without a sign [1/m]; (along, aside): the point as seen along the arc, see
    `find_nearest`; length: of the arc [m]; half: of the body's length [m].
    """
    if bend > 0.0:
        place = math.atan2(bend * aside, along) / bend
    else:
        place = aside if along > 0.0 else math.inf
    return min(max(place - half, 0.0), length) if place <= length + half else length


@kernel
def wall_along(
    memory: Floats,
    rays: int,
    step: float,
    side: float,
    bend: float,
    length: float,
    most: float,
    vehicle: Record,
) -> float:
    """Return how much wall [m] is in an arc's support area, and write how it is spread along it.

    step: angle between two rays [rad]; bend, side, length: as in `free_along`; most: of the wall,
    from which on the rest is not counted.
    """
    core, support, half = CORE * vehicle.width, SUPPORT * vehicle.width, 0.5 * vehicle.length
    squares, xs, ys = KEPT + rays, KEPT + 2 * rays, KEPT + 3 * rays
    bins = KEPT + 4 * rays + FIRST_BIN
    for index in range(BINS):
        memory[bins + index] = 0.0
    half_bend = 0.5 * bend
    middle = half_bend * support * support
    low, high = middle - support, middle + support
    # A point is at least so far along an arc as it is far away, less its distance from the arc.
    farthest = length + half + support
    farthest *= farthest
    wall = 0.0
    for ray in range(rays):
        square, y = memory[squares + ray], side * memory[ys + ray]
        off = half_bend * square - y
        x = memory[xs + ray]
        if off < low or off > high or x < 0.0 or square > farthest:
            continue
        along, lateral = x, abs(y)
        if bend > 0.0:
            along = math.atan2(bend * x, 1.0 - bend * y) / bend
            lateral = abs(math.sqrt(1.0 + 2.0 * bend * off) - 1.0) / bend
        if along > length + half or lateral < core:
            continue
        weight = (support - lateral) / (support - core) * math.sqrt(square) * step
        memory[bins + int(max(along - half, 0.0) / length * (BINS - 1))] += weight
        wall += weight
        if wall > most:
            return wall
    return wall


@kernel
def slide_window(memory: Floats, bins: int, width: float) -> float:
    """Return the share of an arc before the first window with enough wall in it; 1 for none."""
    total = 0.0
    for index in range(BINS):
        total += memory[bins + index]
        if index >= WINDOW:
            total -= memory[bins + index - WINDOW]
        if total > ENOUGH_WALL * width:
            return index / (BINS - 1)
    return 1.0


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
    grip = vehicle.grip * GRAVITY
    sharpest = max(class_radius(number, scale), tightest, speed * speed / grip)
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
    half, jump = GAP_HALF * vehicle.width, GAP_JUMP * vehicle.length
    widen_edges(memory, KEPT, rays, step, half, jump, memory, widened)
    depth = nearest_deepest(memory, widened, rays, field)
    goal = middle_of_gap(memory, widened, rays, field, GAP_DEEP * depth)
    later = LEAD_S + age_of_scan(observation, offsets[LIDAR], rays, setup[DECISION], memory)
    turn = later * observation[offsets[YAW_RATE]]
    place_points(memory, rays, field, later * speed, turn)
    now = math.tan(observation[offsets[STEERING]]) / wheelbase
    drivable = choose_arc(memory, rays, step, speed, now, goal - turn, vehicle)
    control[0] = math.atan(memory[KEPT + 4 * rays + CURVATURE] * wheelbase) / vehicle.steering_limit
    target = _speed(
        memory, KEPT + 4 * rays, vehicle, observation[offsets[GRIP_SCALE]], depth, drivable
    )
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
