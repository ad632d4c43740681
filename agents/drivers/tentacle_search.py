"""Search 81 arcs for what a scan tells of them: how far each is free, and how much wall is beside.

Those of `agents/drivers/tentacles.py`, with the points of one scan in a driver's memory.
"""

import math

from race_agents.planning.scan import move_scan
from race_server.core.kernel_driver import KEPT
from race_server.core.kernels.jit import kernel
from race_server.core.state import Floats, Record

SIDE = 40  # arcs on either side of the straight one
ARCS = 2 * SIDE + 1
EXTRA = 20.0  # [m] that the straight one is longer than the sharpest, for a wheelbase of 2.855 m
GROWTH = 1.15  # of the radius from one arc to the next

# Half-widths of the classification and of the support area [body widths].
CORE, SUPPORT = 0.6, 2.0
BINS, WINDOW = 40, 3
ENOUGH_WALL = 0.15  # body widths of wall within a window that make an obstacle
# What is found, by place in the row of numbers to work with behind the scans.
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
def place_points(memory: Floats, rays: int, field: float, ahead: float, turn: float) -> None:
    """Write the scan's points as seen from where the car will be: x ahead, then y to the left.

    It will have driven `ahead` [m] and turned by `turn` [rad].
    """
    dx, dy = ahead * math.cos(0.5 * turn), ahead * math.sin(0.5 * turn)
    move_scan(memory, rays, field, dx, dy, turn)


@kernel
def square_points(memory: Floats, rays: int) -> None:
    """Write the squared distances [m²] of the points: all arcs are searched by them.

    They go where the widened scan was.
    """
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
