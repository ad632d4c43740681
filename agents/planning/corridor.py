"""The way ahead between two walls, out of one scan: gates from wall to wall, one behind the other.

The rays right of the split belong to the right wall, the others to the left one. Both walls are
walked forward at once, always by the step that keeps the rung between them shorter, as a strip of
triangles is made of two lines. Every so often a rung becomes a gate.

Where the scan jumps, a near edge hides what lies behind it: there the way goes on, out of sight.
The hidden wall is taken to bend away from the edge about as tightly as the car can turn at all;
what bends tighter would not matter to it.
"""

import math

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
# An edge rises by so many times more than its neighbours do: a wall seen at a flat angle, whose
# ranges rise from ray to ray too, is none.
SHARPER = 2.0
# Points of a hidden wall, and the angle between two of them: a right angle and a little more.
HIDDEN, HIDDEN_STEP = 14, math.radians(7.0)
# No gate is wider than this times the narrowest one: the way is about as wide as it was seen.
WIDER = 1.5


@kernel
def largest_edge(ranges: Floats, base: int, rays: int, field: float, jump: float) -> int:
    """Return the ray right of the largest edge, a rise or fall beyond `jump` [m]; -1 for none."""
    best, found = jump, -1
    for ray in range(base + 1, base + rays - 2):
        rise = abs(ranges[ray + 1] - ranges[ray])
        if rise > best and abs(ray_angle(ray - base, rays, field)) <= SIDE:
            before = abs(ranges[ray] - ranges[ray - 1])
            after = abs(ranges[ray + 2] - ranges[ray + 1])
            if rise > SHARPER * max(before, after):
                best, found = rise, ray - base
    return found


@large_kernel
def wall_point(
    memory: Floats, rays: int, split: int, side: float, place: int, hides: float, radius: float
) -> tuple[float, float]:
    """Return point number `place` of a wall, counted from the rear.

    split: the last ray of the right wall; side: 1 for the left wall, -1 for the right one;
    hides: the side of the edge behind which the way goes on, 0 for none; radius: of the hidden
    wall [m], which leaves the line of sight past the edge as a tangent.
    """
    xs, ys = KEPT + 2 * rays, KEPT + 3 * rays
    seen = rays - 1 - split if side > 0.0 else split + 1
    if place < seen:
        ray = rays - 1 - place if side > 0.0 else place
        return memory[xs + ray], memory[ys + ray]
    ray = split + 1 if side > 0.0 else split
    x, y = memory[xs + ray], memory[ys + ray]
    if hides != side:
        return x, y
    distance = max(math.sqrt(x * x + y * y), 1e-3)
    cos, sin = x / distance, y / distance
    angle = HIDDEN_STEP * (place - seen + 1)
    along, aside = radius * math.sin(angle), side * radius * (1.0 - math.cos(angle))
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
    """Write one gate from its ends."""
    dx, dy = left_x - right_x, left_y - right_y
    width = max(math.sqrt(dx * dx + dy * dy), 1e-6)
    memory[out + RIGHT_X + gate] = right_x
    memory[out + RIGHT_Y + gate] = right_y
    memory[out + ACROSS_X + gate] = dx / width
    memory[out + ACROSS_Y + gate] = dy / width
    memory[out + WIDTH + gate] = width


@kernel
def cut_rung(
    lx: float, ly: float, rx: float, ry: float, share: float, hides: float
) -> tuple[float, float, float, float]:
    """Return the ends of a share of a rung, at the edge that hides or else at the nearer end."""
    if hides > 0.0 or (hides == 0.0 and lx * lx + ly * ly < rx * rx + ry * ry):
        return lx, ly, lx + share * (rx - lx), ly + share * (ry - ly)
    return rx + share * (lx - rx), ry + share * (ly - ry), rx, ry


@large_kernel
def find_gates(
    memory: Floats,
    out: int,
    rays: int,
    split: int,
    hides: float,
    radius: float,
    spacing: float,
    narrow: float,
    begin: float,
) -> tuple[int, bool]:
    """Write the gates ahead; return how many, and whether the way is closed behind the last one.

    Their middles are `spacing` [m] apart, the first one lies ahead of `begin` [m]; where the walls
    come nearer to each other than `narrow` [m] there is no way. For the others see `wall_point`.
    """
    lefts, rights = rays - 1 - split, split + 1
    lefts_all = lefts + (HIDDEN if hides > 0.0 else 0)
    rights_all = rights + (HIDDEN if hides < 0.0 else 0)
    left = right = gates = 0
    lx, ly = wall_point(memory, rays, split, 1.0, 0, hides, radius)
    rx, ry = wall_point(memory, rays, split, -1.0, 0, hides, radius)
    next_lx, next_ly = wall_point(memory, rays, split, 1.0, 1, hides, radius)
    next_rx, next_ry = wall_point(memory, rays, split, -1.0, 1, hides, radius)
    middle_x, middle_y, narrowest = begin, 0.0, math.inf
    last_lx, last_ly, last_rx, last_ry = lx, ly, rx, ry
    while gates < GATES:
        if left + 1 >= lefts_all and right + 1 >= rights_all:
            break
        # A hidden wall goes on for ever, so the way is known to the end of the one that is seen.
        if (hides > 0.0 and right + 1 >= rights) or (hides < 0.0 and left + 1 >= lefts):
            break
        by_left = by_right = math.inf
        if left + 1 < lefts_all:
            by_left = (next_lx - rx) * (next_lx - rx) + (next_ly - ry) * (next_ly - ry)
        if right + 1 < rights_all:
            by_right = (next_rx - lx) * (next_rx - lx) + (next_ry - ly) * (next_ry - ly)
        if by_left <= by_right:
            left += 1
            lx, ly = next_lx, next_ly
            next_lx, next_ly = wall_point(memory, rays, split, 1.0, left + 1, hides, radius)
        else:
            right += 1
            rx, ry = next_rx, next_ry
            next_rx, next_ry = wall_point(memory, rays, split, -1.0, right + 1, hides, radius)
        if gates == 0 and 0.5 * (lx + rx) <= begin:
            continue
        width = math.sqrt((lx - rx) * (lx - rx) + (ly - ry) * (ly - ry))
        if width < narrow:
            if gates > 0:
                return gates, True
            continue
        narrowest = min(narrowest, width)
        share = min(max(WIDER * narrowest, 2.0 * narrow) / width, 1.0)
        gate_lx, gate_ly, gate_rx, gate_ry = cut_rung(lx, ly, rx, ry, share, hides)
        dx, dy = 0.5 * (gate_lx + gate_rx) - middle_x, 0.5 * (gate_ly + gate_ry) - middle_y
        moved = math.sqrt(dx * dx + dy * dy)
        if moved < spacing:
            continue
        # Far away the rays are far apart, so between two rungs there may be several gates.
        more = int(moved / spacing) if gates > 0 else 1
        for number in range(min(more, GATES - gates)):
            part = (number + 1) / more
            write_gate(
                memory,
                out,
                gates,
                last_rx + part * (gate_rx - last_rx),
                last_ry + part * (gate_ry - last_ry),
                last_lx + part * (gate_lx - last_lx),
                last_ly + part * (gate_ly - last_ly),
            )
            gates += 1
        middle_x, middle_y = middle_x + dx, middle_y + dy
        last_lx, last_ly, last_rx, last_ry = gate_lx, gate_ly, gate_rx, gate_ry
    return gates, False
