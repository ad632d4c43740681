"""The way ahead between two walls, out of one scan: gates from wall to wall, one behind the other.

The rays right of the split belong to the right wall, the others to the left one. Both walls are
walked forward at once, always by the step that keeps the rung between them shorter, as a strip of
triangles is made of two lines. At equal distances a rung becomes a gate.

Where the scan jumps, a near edge hides what lies behind it: there the way goes on, out of sight.
The hidden wall is taken to bend away from the edge about as tightly as the car can turn at all;
what bends tighter would not matter to it.
"""

import math
from typing import NamedTuple

from race_agents.planning.scan import ray_angle
from race_server.core.kernel_driver import KEPT
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.state import Floats

# Gates at most. Where a number of each gate begins, in a row of numbers to work with: the right
# end [m], the direction from there to the left end, and the width between both [m].
GATES = 20
RIGHT_X, RIGHT_Y, ACROSS_X, ACROSS_Y, WIDTH = range(0, 5 * GATES, GATES)

# An edge is no further to the side than this [rad]: of what lies behind the axles no way goes on.
SIDE = math.radians(92.0)
# An edge rises by this factor more than its neighbours do: a wall seen at a flat angle, whose
# ranges rise from ray to ray too, is none.
SHARPER = 2.0
# Points of a hidden wall, and the angle between two of them: a right angle and a little more.
HIDDEN, HIDDEN_STEP = 14, math.radians(7.0)
# No gate is wider than this times the narrowest one: the way is about as wide as it was seen.
WIDER = 1.5


@kernel
def largest_edge(
    ranges: Floats, base: int, rays: int, field: float, jump: float, across: tuple[int, int]
) -> int:
    """Return the ray right of the largest edge, a rise or fall beyond `jump` [m]; -1 for none.

    ranges: (n,) [m], the scan from `base` on; rays: of the scan; field: angle between the outermost
    rays [rad]; across: first and last ray behind whose edges no way goes on, see `rays_across`.
    """
    best, found = jump, -1
    for ray in range(base + 1, base + rays - 2):
        rise = abs(ranges[ray + 1] - ranges[ray])
        if across[0] - 1 <= ray - base <= across[1]:
            continue
        if rise > best and abs(ray_angle(ray - base, rays, field)) <= SIDE:
            before = abs(ranges[ray] - ranges[ray - 1])
            after = abs(ranges[ray + 2] - ranges[ray + 1])
            if rise > SHARPER * max(before, after):
                best, found = rise, ray - base
    return found


class Walls(NamedTuple):
    """Both walls as one scan shows them, their points in the memory of a driver."""

    memory: Floats
    rays: int
    split: int  # the last ray of the right wall
    hides: float  # side of the edge behind which the way goes on: 1 left, -1 right, 0 none
    radius: float  # of the hidden wall [m], which leaves the line of sight as a tangent


class Rung(NamedTuple):
    """A line between both walls: its left and its right end [m]."""

    lx: float
    ly: float
    rx: float
    ry: float


@large_kernel
def wall_point(walls: Walls, side: float, place: int) -> tuple[float, float]:
    """Return point number `place` of a wall [m], counted from the rear.

    side: 1 for the left wall, -1 for the right one.
    """
    memory, rays, split = walls.memory, walls.rays, walls.split
    xs, ys = KEPT + 2 * rays, KEPT + 3 * rays
    visible = rays - 1 - split if side > 0.0 else split + 1
    if place < visible:
        ray = rays - 1 - place if side > 0.0 else place
        return memory[xs + ray], memory[ys + ray]
    ray = split + 1 if side > 0.0 else split
    x, y = memory[xs + ray], memory[ys + ray]
    if walls.hides != side:
        return x, y
    distance = max(math.sqrt(x * x + y * y), 1e-3)
    cos, sin = x / distance, y / distance
    angle = HIDDEN_STEP * (place - visible + 1)
    along, aside = walls.radius * math.sin(angle), side * walls.radius * (1.0 - math.cos(angle))
    return x + along * cos - aside * sin, y + along * sin + aside * cos


@kernel
def write_gate(
    memory: Floats,
    out: int,
    gate: int,
    right_x: float,
    right_y: float,
    left_x: float,
    left_y: float,
) -> None:
    """Write one gate from its ends.

    memory: (M,) of the driver; out: place of the gates in it; gate: number of this one; right_x,
    right_y, left_x, left_y: its ends in the frame of the kart [m].
    """
    dx, dy = left_x - right_x, left_y - right_y
    width = max(math.sqrt(dx * dx + dy * dy), 1e-6)
    memory[out + RIGHT_X + gate] = right_x
    memory[out + RIGHT_Y + gate] = right_y
    memory[out + ACROSS_X + gate] = dx / width
    memory[out + ACROSS_Y + gate] = dy / width
    memory[out + WIDTH + gate] = width


@kernel
def cut_rung(rung: Rung, share: float, hides: float) -> Rung:
    """Return a share of a rung, from the edge that hides or else from the nearer end.

    share: 0 to 1; hides: side of the edge, see `Walls`.
    """
    lx, ly, rx, ry = rung
    if hides > 0.0 or (hides == 0.0 and lx * lx + ly * ly < rx * rx + ry * ry):
        return Rung(lx, ly, lx + share * (rx - lx), ly + share * (ry - ly))
    return Rung(rx + share * (lx - rx), ry + share * (ly - ry), rx, ry)


@large_kernel
def next_rung(walls: Walls, left: int, right: int, rung: Rung) -> tuple[int, int, Rung]:
    """Return the next rung, and the numbers of the points that it connects.

    One step on along the wall where the rung stays shorter; -1 where both walls end. walls: of one
    scan; left, right: numbers of the points that the present rung connects, counted from the rear;
    rung: its ends [m].
    """
    lefts, rights = walls.rays - 1 - walls.split, walls.split + 1
    lefts_all = lefts + (HIDDEN if walls.hides > 0.0 else 0)
    rights_all = rights + (HIDDEN if walls.hides < 0.0 else 0)
    if left + 1 >= lefts_all and right + 1 >= rights_all:
        return -1, -1, rung
    # A hidden wall has no end, so the way is known to the end of the one that is seen.
    if (walls.hides > 0.0 and right + 1 >= rights) or (walls.hides < 0.0 and left + 1 >= lefts):
        return -1, -1, rung
    by_left = by_right = math.inf
    lx = ly = rx = ry = 0.0
    if left + 1 < lefts_all:
        lx, ly = wall_point(walls, 1.0, left + 1)
        by_left = (lx - rung.rx) * (lx - rung.rx) + (ly - rung.ry) * (ly - rung.ry)
    if right + 1 < rights_all:
        rx, ry = wall_point(walls, -1.0, right + 1)
        by_right = (rx - rung.lx) * (rx - rung.lx) + (ry - rung.ly) * (ry - rung.ly)
    if by_left <= by_right:
        return left + 1, right, Rung(lx, ly, rung.rx, rung.ry)
    return left, right + 1, Rung(rung.lx, rung.ly, rx, ry)


@kernel
def write_gates(memory: Floats, out: int, gates: int, last: Rung, rung: Rung, more: int) -> int:
    """Write `more` gates at equal distances after the rung `last`, up to `rung`; return the count.

    memory: (M,) of the driver; out: place of the gates in it; gates: gates written before; last,
    rung: their ends [m].
    """
    for number in range(min(more, GATES - gates)):
        part = (number + 1) / more
        write_gate(
            memory,
            out,
            gates + number,
            last.rx + part * (rung.rx - last.rx),
            last.ry + part * (rung.ry - last.ry),
            last.lx + part * (rung.lx - last.lx),
            last.ly + part * (rung.ly - last.ly),
        )
    return gates + min(more, GATES - gates)


@large_kernel
def find_gates(
    walls: Walls, out: int, spacing: float, narrow: float, begin: float
) -> tuple[int, bool]:
    """Write the gates ahead; return how many, and whether the way is closed behind the last one.

    walls: of one scan; out: place of the gates in its memory. Their middles are `spacing` [m]
    apart, the first one lies ahead of `begin` [m]; walls nearer to each other than `narrow` [m]
    leave no way.
    """
    left = right = gates = 0
    lx, ly = wall_point(walls, 1.0, 0)
    rx, ry = wall_point(walls, -1.0, 0)
    last = whole = Rung(lx, ly, rx, ry)
    middle_x, middle_y, narrowest = begin, 0.0, math.inf
    while gates < GATES:
        left, right, whole = next_rung(walls, left, right, whole)
        if left < 0:
            break
        lx, ly, rx, ry = whole
        if gates == 0 and 0.5 * (lx + rx) <= begin:
            continue
        width = math.sqrt((lx - rx) * (lx - rx) + (ly - ry) * (ly - ry))
        if width < narrow:
            if gates > 0:
                return gates, True
            continue
        narrowest = min(narrowest, width)
        share = min(max(WIDER * narrowest, 2.0 * narrow) / width, 1.0)
        rung = cut_rung(whole, share, walls.hides)
        dx, dy = 0.5 * (rung.lx + rung.rx) - middle_x, 0.5 * (rung.ly + rung.ry) - middle_y
        moved = math.sqrt(dx * dx + dy * dy)
        if moved < spacing:
            continue
        # Far away the rays are far apart, so between two rungs there may be several gates.
        more = int(moved / spacing) if gates > 0 else 1
        gates = write_gates(walls.memory, out, gates, last, rung, more)
        middle_x, middle_y = middle_x + dx, middle_y + dy
        last = rung
    return gates, False
