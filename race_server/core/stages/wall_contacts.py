"""Where bodies meet walls and blocks: finding, separating, impulses. Free of rules of the game."""

import math

import numpy as np

from race_server.core import codes
from race_server.core.kernels.boxes import (
    Box,
    Hull,
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
    box_on_segment,
    impulse,
    touching_point,
)
from race_server.core.kernels.geometry import cos_sin
from race_server.core.kernels.jit import kernel
from race_server.core.stages.blocks import (
    Standing,
    block_hull,
    is_near_block,
    is_own_block,
    may_touch_blocks,
)
from race_server.core.stages.contacts import Blow, is_blow, no_blow
from race_server.core.state import Record, Records, Walls


@kernel
def next_wall_blow(
    bodies: Records,
    vehicles: Records,
    walls: Walls,
    site: Record,
    standing: Standing,
    material: Material,
    softest: float,
    cursor: int,
) -> Blow:
    """Return the next body's first blow on a wall or block that is harder than `softest` [m/s].

    bodies: (K,) BODY of one world; vehicles: (K,) VEHICLE; site: SITE of the world; cursor: 0 at
    the start of a substep, then that of the blow before. Bodies are pushed off all that they touch.
    """
    for k in range(cursor, len(bodies)):
        body = bodies[k]
        if body.trust >= codes.DOUBTFUL:
            continue
        if body.status == codes.RACING or body.status == codes.FINISHED:
            hit = no_blow()
            for number in range(box_count(vehicles[k])):
                if not _is_clear(walls, site, hull_of(vehicles[k], body, number)):
                    other = _meet_walls(body, vehicles[k], number, walls, site, material, softest)
                    hit = hit if is_blow(hit) else other
            if len(standing.blocks) > 0 and may_touch_blocks(
                body, vehicles[k], k, len(bodies), standing
            ):
                other = _meet_blocks(bodies, vehicles, k, standing.blocks, material, softest)
                hit = hit if is_blow(hit) else other
            if is_blow(hit):
                return Blow(
                    k + 1,
                    k,
                    -1,
                    hit.impulse,
                    hit.closing,
                    hit.nx,
                    hit.ny,
                    hit.closing,
                    0.0,
                    hit.kind,
                )
    return no_blow()


@kernel
def is_free_of_walls(walls: Walls, site: Record, hull: Hull) -> bool:
    """Return whether a hull touches no wall. site: SITE."""
    if _is_clear(walls, site, hull):
        return True
    box = box_of(hull)
    first_column, last_column, first_row, last_row = _cells_under(site, box)
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            cell = site.cell_start + row * site.columns + column
            for entry in range(walls.cell_first[cell], walls.cell_first[cell + 1]):
                wall = walls.segments[site.wall_start + walls.cell_walls[entry]]
                if box_on_segment(box, wall[0], wall[1], wall[2], wall[3])[0] > 0.0:
                    return False
    return True


@kernel
def is_outside_of_walls(walls: Walls, site: Record, hull: Hull) -> bool:
    """Return whether a hull in a car park touches no wall, and lies in nothing solid. site: SITE.

    Sides go around the area counter-clockwise and around what is solid clockwise. So from a free
    place they turn once in all, and from one in a solid less.
    """
    if not is_free_of_walls(walls, site, hull):
        return False
    box, turns = box_of(hull), 0
    for number in range(site.wall_start, site.wall_start + site.wall_count):
        wall = walls.segments[number]
        if (wall[1] <= box.y) != (wall[3] <= box.y):
            dx, dy = wall[2] - wall[0], wall[3] - wall[1]
            is_left = dx * (box.y - wall[1]) > dy * (box.x - wall[0])
            if is_left == (dy > 0.0):
                turns += 1 if is_left else -1
    return turns == 1


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
    first_column, last_column, first_row, last_row = _cells_under(site, box)
    for row in range(first_row, last_row + 1):
        for column in range(first_column, last_column + 1):
            cell = site.cell_start + row * site.columns + column
            for entry in range(walls.cell_first[cell], walls.cell_first[cell + 1]):
                wall = site.wall_start + walls.cell_walls[entry]
                x0, y0 = walls.segments[wall, 0], walls.segments[wall, 1]
                x1, y1 = walls.segments[wall, 2], walls.segments[wall, 3]
                depth, nx, ny = box_on_segment(box, x0, y0, x1, y1)
                if depth > 0.0:
                    # Of one type with the kinds of blocks.
                    kind = int(np.int64(walls.kinds[wall]))
                    blow = _meet_solid(body, vehicle, box, (depth, nx, ny), kind, material)
                    if first.impulse == 0.0 and blow.closing > softest:
                        first = blow
                    box = box_of(hull_of(vehicle, body, number))
    return first


@kernel
def _cells_under(site: Record, box: Box) -> tuple[int, int, int, int]:
    """Return the first and last column, and the first and last row, of cells under a box."""
    reach_x = box.half_length * abs(box.cos) + box.half_width * abs(box.sin)
    reach_y = box.half_length * abs(box.sin) + box.half_width * abs(box.cos)
    scale = 1.0 / site.cell
    first_column = max(math.floor((box.x - reach_x - site.x0) * scale), 0)
    last_column = min(math.floor((box.x + reach_x - site.x0) * scale), site.columns - 1)
    first_row = max(math.floor((box.y - reach_y - site.y0) * scale), 0)
    last_row = min(math.floor((box.y + reach_y - site.y0) * scale), site.rows - 1)
    return first_column, last_column, first_row, last_row


@kernel
def _meet_blocks(
    bodies: Records,
    vehicles: Records,
    k: int,
    blocks: Records,
    material: Material,
    softest: float,
) -> Blow:
    """Push body k off the blocks that its boxes touch; return the first hard blow.

    bodies: (K,) BODY; vehicles: (K,) VEHICLE; blocks: (B,) BLOCK, of which some are the body
    itself; softest: closing speed above which a blow is hard [m/s].
    """
    first = no_blow()
    body, vehicle = bodies[k], vehicles[k]
    reach = reach_of(vehicle)
    for b in range(len(blocks)):
        if not is_near_block(blocks[b], body.x, body.y, reach):
            continue
        if is_own_block(vehicle, k, len(bodies), b):
            continue
        for number in range(box_count(vehicle)):
            box = box_of(hull_of(vehicle, body, number))
            depth, nx, ny = box_on_box(box, box_of(block_hull(blocks[b])))
            if depth > 0.0:
                kind = blocks[b].kind
                blow = _meet_solid(body, vehicle, box, (depth, nx, ny), kind, material)
                if first.impulse == 0.0 and blow.closing > softest:
                    first = blow
    return first


@kernel
def _meet_solid(
    body: Record,
    vehicle: Record,
    box: Box,
    touch: tuple[float, float, float],
    kind: int,
    material: Material,
) -> Blow:
    """Push a body off something that does not move and return the blow.

    body: BODY; vehicle: VEHICLE; box: that touched; touch: depth [m] and unit normal, towards the
    body; kind: RayHit of what was met.
    """
    depth, nx, ny = touch
    # A real kart is where it is: its touch counts, but no blow moves it.
    is_free = body.trust <= codes.SIMULATED
    if is_free:
        body.x += depth * nx
        body.y += depth * ny
    offset = hull_of(vehicle, body, box.number).offset
    px, py = touching_point(box, nx, ny)
    px, py = px + offset * box.cos, py + offset * box.sin
    vx, vy = velocity_at(body, vehicle, box, px, py)
    closing, sliding = vx * nx + vy * ny, vy * nx - vx * ny
    moved, turned = yielding(body, vehicle, box, px, py, nx, ny)
    mass_n = 1.0 / (moved + turned)
    moved, turned = yielding(body, vehicle, box, px, py, -ny, nx)
    mass_t = 1.0 / (moved + turned)
    along, across = impulse(closing, sliding, mass_n, mass_t, material)
    if along <= 0.0:
        return no_blow()
    if is_free:
        push(body, vehicle, box, px, py, along * nx - across * ny, along * ny + across * nx)
    return Blow(-1, -1, -1, along, -closing, nx, ny, -closing, 0.0, kind)
