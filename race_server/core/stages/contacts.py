"""Where bodies meet walls and each other: finding, separating, impulses. Free of rules of the game.

What happened is returned as blows, one at a time, so that a game can judge each before the next: a
stage asks for the next blow until there is none.
"""

import math
from typing import NamedTuple

from race_server.core import codes
from race_server.core.kernels.boxes import (
    Box,
    Hull,
    box_count,
    box_of,
    hull_of,
    inertia_of,
    push,
    reach_of,
    velocity_at,
)
from race_server.core.kernels.contacts import (
    Material,
    box_on_box,
    box_on_segment,
    impulse,
    touching_point,
)
from race_server.core.kernels.geometry import cos_sin
from race_server.core.kernels.jit import kernel
from race_server.core.state import Record, Records, Walls


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


@kernel
def no_blow() -> Blow:
    """Return the blow that means that there was none."""
    return Blow(-1, -1, -1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@kernel
def is_blow(blow: Blow) -> bool:
    """Return whether there was a blow."""
    return blow.impulse > 0.0


@kernel
def find_contact_pairs(bodies: Records, vehicles: Records) -> None:
    """Record for every body, as bits, which of those after it may meet it within this tick.

    bodies: (K,) BODY of one world; vehicles: (K,) VEHICLE.
    """
    for k in range(len(bodies)):
        body, reach = bodies[k], reach_of(vehicles[k])
        pairs = 0
        for other in range(k + 1, len(bodies)):
            dx, dy = bodies[other].x - body.x, bodies[other].y - body.y
            # Bodies further apart than the sum of their reaches cannot touch; twice that leaves
            # room for what both drive in a tick: no kart drives its own length in 1/60 s.
            near = 2.0 * (reach + reach_of(vehicles[other]))
            if dx * dx + dy * dy < near * near:
                pairs |= 1 << (other - k - 1)
        body.contact_pairs = pairs


@kernel
def next_body_blow(
    bodies: Records, vehicles: Records, tick: int, material: Material, cursor: int
) -> Blow:
    """Return the next blow between two bodies, which are separated and pushed.

    bodies: (K,) BODY of one world; vehicles: (K,) VEHICLE; tick: of the world; cursor: 0 at the
    start of a substep, then that of the blow before. Needs the pairs of `find_contact_pairs`.
    """
    count = len(bodies)
    first, second = cursor // count, cursor % count
    while first < count:
        # Second 0 stands for the begin of a row: no pair has it.
        if second == 0 and (bodies[first].contact_pairs == 0 or not is_solid(bodies[first], tick)):
            first += 1
            continue
        second = max(second, first + 1)
        while second < count:
            is_pair = bodies[first].contact_pairs >> (second - first - 1) & 1
            if is_pair and is_solid(bodies[second], tick):
                blow = _meet_body(bodies, vehicles, first, second, material)
                if is_blow(blow):
                    return blow
            second += 1
        first, second = first + 1, 0
    return no_blow()


@kernel
def is_solid(body: Record, tick: int) -> bool:
    """Return whether other bodies can touch a body."""
    if body.status != codes.RACING or body.trust >= codes.DOUBTFUL:
        return False
    return bool(tick >= body.ghost_until)


@kernel
def _meet_body(
    bodies: Records, vehicles: Records, first: int, second: int, material: Material
) -> Blow:
    """Return the hardest blow between the boxes of two bodies.

    bodies: (K,) BODY of one world; vehicles: (K,) VEHICLE; first, second: numbers of the bodies.
    """
    hardest = no_blow()
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
                blow = _strike(bodies, vehicles, (first, second), box_a, box_b, (nx, ny), material)
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
    a_moves, b_moves = a.trust == codes.SIMULATED, b.trust == codes.SIMULATED
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
    pair: tuple[int, int],
    box_a: Box,
    box_b: Box,
    normal: tuple[float, float],
    material: Material,
) -> Blow:
    """Push two bodies whose boxes touched and return the blow.

    bodies: (K,) BODY of one world; vehicles: (K,) VEHICLE; pair: numbers of the two; box_a, box_b:
    the boxes that touched; normal: of length 1, towards the first body.
    """
    (first, second), (nx, ny) = pair, normal
    a, b, va, vb = bodies[first], bodies[second], vehicles[first], vehicles[second]
    part_a, part_b = hull_of(va, a, box_a.number), hull_of(vb, b, box_b.number)
    # The blow acts in the middle between the two points that lie deepest.
    ax, ay = touching_point(box_a, nx, ny)
    bx, by = touching_point(box_b, -nx, -ny)
    ahead_a, ahead_b = part_a.offset, part_b.offset
    mx = 0.5 * (part_a.x + ahead_a * box_a.cos + ax + part_b.x + ahead_b * box_b.cos + bx)
    my = 0.5 * (part_a.y + ahead_a * box_a.sin + ay + part_b.y + ahead_b * box_b.sin + by)
    ax, ay, bx, by = mx - part_a.x, my - part_a.y, mx - part_b.x, my - part_b.y
    vax, vay = velocity_at(a, box_a, ax, ay)
    vbx, vby = velocity_at(b, box_b, bx, by)
    closing = (vax - vbx) * nx + (vay - vby) * ny
    sliding = (vay - vby) * nx - (vax - vbx) * ny
    # Real karts take no impulse; a blow between two of them is reported nevertheless.
    a_moves, b_moves = a.trust == codes.SIMULATED, b.trust == codes.SIMULATED
    a_counts = 1.0 if a_moves or not b_moves else 0.0
    b_counts = 1.0 if b_moves or not a_moves else 0.0
    (ma, ia), (mb, ib) = inertia_of(va, box_a.number), inertia_of(vb, box_b.number)
    inverse = a_counts / ma + b_counts / mb
    na, ta, nb, tb = ax * ny - ay * nx, ax * nx + ay * ny, bx * ny - by * nx, bx * nx + by * ny
    mass_n = 1.0 / (inverse + a_counts * na * na / ia + b_counts * nb * nb / ib)
    mass_t = 1.0 / (inverse + a_counts * ta * ta / ia + b_counts * tb * tb / ib)
    along, across = impulse(closing, sliding, mass_n, mass_t, material)
    if along <= 0.0:
        return no_blow()
    jx, jy = along * nx - across * ny, along * ny + across * nx
    if a_moves:
        push(a, va, box_a, ax, ay, jx, jy)
    if b_moves:
        push(b, vb, box_b, bx, by, -jx, -jy)
    cursor = first * len(bodies) + second + 1
    approach_a, approach_b = -(vax * nx + vay * ny), vbx * nx + vby * ny
    return Blow(cursor, first, second, along, -closing, nx, ny, approach_a, approach_b)


@kernel
def next_wall_blow(
    bodies: Records,
    vehicles: Records,
    walls: Walls,
    site: Record,
    material: Material,
    softest: float,
    cursor: int,
) -> Blow:
    """Return the next body's first blow on a wall that is harder than `softest` [m/s].

    bodies: (K,) BODY of one world; vehicles: (K,) VEHICLE; site: SITE of the world; cursor: 0 at
    the start of a substep, then that of the blow before. Bodies are pushed off all walls that they
    touch.
    """
    for k in range(cursor, len(bodies)):
        body = bodies[k]
        if body.trust >= codes.DOUBTFUL:
            continue
        if body.status == codes.RACING or body.status == codes.FINISHED:
            for number in range(box_count(vehicles[k])):
                if _is_clear(walls, site, hull_of(vehicles[k], body, number)):
                    continue
                hit = _meet_walls(body, vehicles[k], number, walls, site, material, softest)
                if is_blow(hit):
                    speed = hit.closing
                    return Blow(k + 1, k, -1, hit.impulse, speed, hit.nx, hit.ny, speed, 0.0)
    return no_blow()


@kernel
def _is_clear(walls: Walls, site: Record, hull: Hull) -> bool:
    """Return whether the place of a hull alone shows that it touches no wall.

    First as a disc around the whole box, then as two, one around either half.
    """
    quarter, half_width = 0.5 * hull.half_length, hull.half_width
    whole = hull.half_length + abs(hull.offset)
    if _is_disc_clear(walls, site, hull.x, hull.y, whole * whole + half_width * half_width):
        return True
    cos, sin = cos_sin(hull.heading)
    square = quarter * quarter + half_width * half_width
    front, rear = hull.offset + quarter, hull.offset - quarter
    return _is_disc_clear(
        walls, site, hull.x + front * cos, hull.y + front * sin, square
    ) and _is_disc_clear(walls, site, hull.x + rear * cos, hull.y + rear * sin, square)


@kernel
def _is_disc_clear(walls: Walls, site: Record, x: float, y: float, square: float) -> bool:
    """Return whether no wall comes near a place.

    site: SITE; x, y: the place [m]; square: of the distance to keep free [m²].
    """
    column = math.floor((x - site.x0) / site.cell)
    row = math.floor((y - site.y0) / site.cell)
    if column < 0 or row < 0 or column >= site.columns or row >= site.rows:
        return True
    clear = float(walls.cell_clear[site.cell_start + row * site.columns + column])
    return bool(clear * clear >= square)


@kernel
def _meet_walls(
    body: Record,
    vehicle: Record,
    number: int,
    walls: Walls,
    site: Record,
    material: Material,
    softest: float,
) -> Blow:
    """Push a body off the walls that one of its boxes touches; return the first hard blow.

    body: BODY; vehicle: VEHICLE; number: of the box; site: SITE; softest: closing speed above which
    a blow is hard [m/s].
    """
    first = no_blow()
    box = box_of(hull_of(vehicle, body, number))
    reach_x = box.half_length * abs(box.cos) + box.half_width * abs(box.sin)
    reach_y = box.half_length * abs(box.sin) + box.half_width * abs(box.cos)
    scale = 1.0 / site.cell
    first_column = max(math.floor((box.x - reach_x - site.x0) * scale), 0)
    last_column = min(math.floor((box.x + reach_x - site.x0) * scale), site.columns - 1)
    first_row = max(math.floor((box.y - reach_y - site.y0) * scale), 0)
    last_row = min(math.floor((box.y + reach_y - site.y0) * scale), site.rows - 1)
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            cell = site.cell_start + row * site.columns + column
            for entry in range(walls.cell_first[cell], walls.cell_first[cell + 1]):
                wall = site.wall_start + walls.cell_walls[entry]
                x0, y0 = walls.segments[wall, 0], walls.segments[wall, 1]
                x1, y1 = walls.segments[wall, 2], walls.segments[wall, 3]
                depth, nx, ny = box_on_segment(box, x0, y0, x1, y1)
                if depth > 0.0:
                    blow = _meet_wall(body, vehicle, box, depth, nx, ny, material)
                    if first.impulse == 0.0 and blow.closing > softest:
                        first = blow
                    box = box_of(hull_of(vehicle, body, number))
    return first


@kernel
def _meet_wall(
    body: Record,
    vehicle: Record,
    box: Box,
    depth: float,
    nx: float,
    ny: float,
    material: Material,
) -> Blow:
    """Push a body `depth` [m] off a wall along the normal and return the blow.

    body: BODY; vehicle: VEHICLE; box: that touched; nx, ny: unit normal, towards the body.
    """
    # A real kart is where it is: its touch counts, but no blow moves it.
    is_free = body.trust == codes.SIMULATED
    if is_free:
        body.x += depth * nx
        body.y += depth * ny
    offset = hull_of(vehicle, body, box.number).offset
    px, py = touching_point(box, nx, ny)
    px, py = px + offset * box.cos, py + offset * box.sin
    vx, vy = velocity_at(body, box, px, py)
    closing, sliding = vx * nx + vy * ny, vy * nx - vx * ny
    lever_n, lever_t = px * ny - py * nx, px * nx + py * ny
    mass, inertia = inertia_of(vehicle, box.number)
    mass_n = 1.0 / (1.0 / mass + lever_n * lever_n / inertia)
    mass_t = 1.0 / (1.0 / mass + lever_t * lever_t / inertia)
    along, across = impulse(closing, sliding, mass_n, mass_t, material)
    if along <= 0.0:
        return no_blow()
    if is_free:
        push(body, vehicle, box, px, py, along * nx - across * ny, along * ny + across * nx)
    return Blow(-1, -1, -1, along, -closing, nx, ny, -closing, 0.0)
