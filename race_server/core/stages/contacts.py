"""Where bodies meet each other: finding, separating, impulses. Free of rules of the game.

What happened is returned as blows, one at a time, so that a game can judge each before the next: a
stage asks for the next blow until there is none.
"""

from typing import NamedTuple

from race_server.core import codes
from race_server.core.kernels.boxes import (
    Box,
    box_count,
    box_of,
    hull_of,
    push,
    reach_of,
    velocity_at,
    yielding,
)
from race_server.core.kernels.contacts import (
    Material,
    box_on_box,
    impulse,
    touching_point,
)
from race_server.core.kernels.jit import kernel
from race_server.core.state import Ints, Record, Records


class Blow(NamedTuple):
    """One meeting of two bodies, or of a body and a wall, after the impulse; see `is_blow`."""

    cursor: int  # where to look for the next blow
    first: int  # number of the body that was hit
    second: int  # number of the other body, -1 for a wall
    impulse: float  # [N s] along the normal, 0 if there was no blow
    closing: float  # [m/s] speed at which the two came together
    nx: float  # unit normal, towards the first body
    ny: float
    first_approach: float  # [m/s] the first body's own part of `closing`
    second_approach: float  # [m/s]
    kind: int  # RayHit of what the first body met


@kernel
def no_blow() -> Blow:
    """Return the blow that means that there was none."""
    return Blow(-1, -1, -1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, codes.NOTHING)


@kernel
def is_blow(blow: Blow) -> bool:
    """Return whether there was a blow."""
    return blow.impulse > 0.0


@kernel
def find_contact_pairs(bodies: Records, vehicles: Records, turns: Ints) -> None:
    """Record for every body, as bits, which of those after it may meet it within this tick.

    bodies: (K,) BODY of one world; vehicles: (K,) VEHICLE; turns: (K,) numbers of the bodies in
    the order in which they meet.
    """
    for turn in range(len(turns)):
        k = turns[turn]
        body, reach = bodies[k], reach_of(vehicles[k])
        pairs = 0
        for later in range(turn + 1, len(turns)):
            other = turns[later]
            dx, dy = bodies[other].x - body.x, bodies[other].y - body.y
            # Bodies further apart than the sum of their reaches cannot touch; twice that leaves
            # room for what both drive in a tick: no kart drives its own length in 1/60 s.
            near = 2.0 * (reach + reach_of(vehicles[other]))
            if dx * dx + dy * dy < near * near:
                pairs |= 1 << (later - turn - 1)
        body.contact_pairs = pairs


@kernel
def next_body_blow(
    bodies: Records, vehicles: Records, turns: Ints, tick: int, material: Material, cursor: int
) -> Blow:
    """Return the next blow between two bodies, which are separated and pushed.

    bodies: (K,) BODY of one world; vehicles: (K,) VEHICLE; turns: (K,) numbers of the bodies in
    the order in which they meet; tick: of the world; cursor: 0 at the start of a substep, then
    that of the blow before. Needs the pairs of `find_contact_pairs`.
    """
    count = len(turns)
    turn, later = cursor // count, cursor % count
    while turn < count:
        first = turns[turn]
        # Turn 0 of the second body stands for the begin of a row: no pair has it.
        if later == 0 and (bodies[first].contact_pairs == 0 or not is_solid(bodies[first], tick)):
            turn += 1
            continue
        later = max(later, turn + 1)
        while later < count:
            second = turns[later]
            is_pair = bodies[first].contact_pairs >> (later - turn - 1) & 1
            later += 1
            if is_pair and is_solid(bodies[second], tick):
                pair = first, second, turn * count + later
                blow = _meet_body(bodies, vehicles, pair, material)
                if is_blow(blow):
                    return blow
        turn, later = turn + 1, 0
    return no_blow()


@kernel
def is_solid(body: Record, tick: int) -> bool:
    """Return whether other bodies can touch a body."""
    if body.status != codes.RACING or body.trust >= codes.DOUBTFUL:
        return False
    return bool(tick >= body.ghost_until)


@kernel
def _meet_body(
    bodies: Records, vehicles: Records, pair: tuple[int, int, int], material: Material
) -> Blow:
    """Return the hardest blow between the boxes of two bodies.

    bodies: (K,) BODY of one world; vehicles: (K,) VEHICLE; pair: numbers of the bodies, and the
    cursor after them.
    """
    hardest, (first, second, _) = no_blow(), pair
    a, b, va, vb = bodies[first], bodies[second], vehicles[first], vehicles[second]
    dx, dy, near = b.x - a.x, b.y - a.y, reach_of(va) + reach_of(vb)
    if dx * dx + dy * dy >= near * near:
        return hardest
    for one in range(box_count(va)):
        for two in range(box_count(vb)):
            box_a, box_b = box_of(hull_of(va, a, one)), box_of(hull_of(vb, b, two))
            depth, nx, ny = box_on_box(box_a, box_b)
            if depth > 0.0:
                _separate(a, b, va, vb, depth, nx, ny)
                blow = _strike(bodies, vehicles, pair, box_a, box_b, (nx, ny), material)
                if blow.impulse > hardest.impulse:
                    hardest = blow
    return hardest


@kernel
def _separate(
    a: Record, b: Record, va: Record, vb: Record, depth: float, nx: float, ny: float
) -> None:
    """Move two bodies apart by `depth` [m] along the normal, the lighter one further.

    a, b: BODY; va, vb: their VEHICLE; nx, ny: unit normal, towards `a`.
    """
    # Real karts stand like walls; two of them stay where they are.
    a_moves, b_moves = a.trust <= codes.SIMULATED, b.trust <= codes.SIMULATED
    share = vb.mass / (va.mass + vb.mass)
    if not (a_moves and b_moves):
        share = 1.0 if a_moves else 0.0
    depth = depth if a_moves or b_moves else 0.0
    a.x += share * depth * nx
    a.y += share * depth * ny
    b.x -= (1.0 - share) * depth * nx
    b.y -= (1.0 - share) * depth * ny


@kernel
def _strike(
    bodies: Records,
    vehicles: Records,
    pair: tuple[int, int, int],
    box_a: Box,
    box_b: Box,
    normal: tuple[float, float],
    material: Material,
) -> Blow:
    """Push two bodies whose boxes touched and return the blow.

    bodies: (K,) BODY of one world; vehicles: (K,) VEHICLE; pair: numbers of the two, and the
    cursor after them; box_a, box_b: the boxes that touched; normal: of length 1, towards the first
    body.
    """
    (first, second, cursor), (nx, ny) = pair, normal
    a, b, va, vb = bodies[first], bodies[second], vehicles[first], vehicles[second]
    part_a, part_b = hull_of(va, a, box_a.number), hull_of(vb, b, box_b.number)
    # The blow acts in the middle between the two points that lie deepest.
    ax, ay = touching_point(box_a, nx, ny)
    bx, by = touching_point(box_b, -nx, -ny)
    ahead_a, ahead_b = part_a.offset, part_b.offset
    mx = 0.5 * (part_a.x + ahead_a * box_a.cos + ax + part_b.x + ahead_b * box_b.cos + bx)
    my = 0.5 * (part_a.y + ahead_a * box_a.sin + ay + part_b.y + ahead_b * box_b.sin + by)
    ax, ay, bx, by = mx - part_a.x, my - part_a.y, mx - part_b.x, my - part_b.y
    vax, vay = velocity_at(a, va, box_a, ax, ay)
    vbx, vby = velocity_at(b, vb, box_b, bx, by)
    closing = (vax - vbx) * nx + (vay - vby) * ny
    sliding = (vay - vby) * nx - (vax - vbx) * ny
    # Real karts take no impulse; a blow between two of them is reported nevertheless.
    a_moves, b_moves = a.trust <= codes.SIMULATED, b.trust <= codes.SIMULATED
    a_counts = 1.0 if a_moves or not b_moves else 0.0
    b_counts = 1.0 if b_moves or not a_moves else 0.0
    (moved_a, turned_a), (moved_b, turned_b) = (
        yielding(a, va, box_a, ax, ay, nx, ny),
        yielding(b, vb, box_b, bx, by, nx, ny),
    )
    inverse = a_counts * moved_a + b_counts * moved_b
    mass_n = 1.0 / (inverse + a_counts * turned_a + b_counts * turned_b)
    (moved_a, turned_a), (moved_b, turned_b) = (
        yielding(a, va, box_a, ax, ay, -ny, nx),
        yielding(b, vb, box_b, bx, by, -ny, nx),
    )
    inverse = a_counts * moved_a + b_counts * moved_b
    mass_t = 1.0 / (inverse + a_counts * turned_a + b_counts * turned_b)
    along, across = impulse(closing, sliding, mass_n, mass_t, material)
    if along <= 0.0:
        return no_blow()
    jx, jy = along * nx - across * ny, along * ny + across * nx
    if a_moves:
        push(a, va, box_a, ax, ay, jx, jy)
    if b_moves:
        push(b, vb, box_b, bx, by, -jx, -jy)
    approach_a, approach_b = -(vax * nx + vay * ny), vbx * nx + vby * ny
    kind = codes.KART_HIT
    return Blow(cursor, first, second, along, -closing, nx, ny, approach_a, approach_b, kind)
