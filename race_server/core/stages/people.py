"""People in a car park: they walk from place to place, yield to no vehicle, and may be hit."""

import math

from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.kernels.boxes import Box, Hull, box_count, box_of, grown, hull_of, reach_of
from race_server.core.kernels.contacts import box_on_segment
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.rng import WALKER_STREAM, uniform
from race_server.core.lots import PEOPLE
from race_server.core.stages.blocks import block_hull, is_near_block
from race_server.core.stages.events import report, retire
from race_server.core.stages.wall_contacts import is_free_of_walls, is_outside_of_walls
from race_server.core.stages.zones import point_in, zone_for
from race_server.core.state import Record, World

# A vehicle slower than this [m/s] stands: a person who walks into it was not hit by it.
STANDING = 0.1
# Where a person goes next is drawn at most this many times, so that no block or wall is in the way.
LEG_TRIES = 8
# Numbers for each leg of a walk.
DRAWS = 4 + 3 * LEG_TRIES


@kernel
def walk(world: World, w: int) -> None:
    """Move every person on by one tick, then see which of them a vehicle touches."""
    walkers = world.parking.walkers[w]
    for p in range(len(walkers)):
        if walkers[p].radius <= 0.0:
            continue
        _step(world, w, p)
        walkers[p].against = 0
        for k in range(world.bodies.shape[1]):
            if world.bodies[w, k].status == codes.RACING and _touches(world, w, k, walkers[p]):
                walkers[p].against = k + 1
                _judge(world, w, k, p)
            else:
                walkers[p].touching &= ~(1 << k)
                walkers[p].hit &= ~(1 << k)


@kernel
def _step(world: World, w: int, p: int) -> None:
    """Move a person on by one tick, or let them rest, or begin another leg."""
    walker = world.parking.walkers[w, p]
    dx, dy = walker.to_x - walker.x, walker.to_y - walker.y
    left, step = math.sqrt(dx * dx + dy * dy), walker.speed * TICK_S
    if walker.rest_ticks > 0 and left <= walker.rest_at:
        walker.rest_ticks -= 1
    elif left <= step:
        walker.x, walker.y = walker.to_x, walker.to_y
        _begin_leg(world, w, p)
    else:
        walker.x += dx / left * step
        walker.y += dy / left * step


@kernel
def place_walker(world: World, w: int, p: int) -> None:
    """Put a person where they begin, on their first leg."""
    walker, seed = world.parking.walkers[w, p], world.races[w].seed
    lot = world.parking.lots.lots[world.rules[w].course]
    walker.leg = walker.against = walker.rest_ticks = walker.touching = walker.hit = 0
    walker.x = walker.y = walker.to_x = walker.to_y = walker.speed = walker.rest_at = 0.0
    walker.radius = lot.walker_radius if p < lot.walkers else 0.0
    if p >= lot.walkers:
        return
    for attempt in range(LEG_TRIES):
        chances = 3 * attempt
        zone = zone_for(world, w, PEOPLE, uniform(seed, WALKER_STREAM, p, chances))
        if zone < 0:
            return
        share_x = uniform(seed, WALKER_STREAM, p, chances + 1)
        share_y = uniform(seed, WALKER_STREAM, p, chances + 2)
        walker.x, walker.y = point_in(world.parking.lots.zones[zone], share_x, share_y)
        is_free = _is_free(world, w, walker.x, walker.y, walker.radius)
        if is_free and not _touches_any(world, w, walker):
            break
    _begin_leg(world, w, p)


@kernel
def _begin_leg(world: World, w: int, p: int) -> None:
    """Draw where a person walks next, how fast, and whether they stop on the way."""
    walker, seed = world.parking.walkers[w, p], world.races[w].seed
    lot = world.parking.lots.lots[world.rules[w].course]
    walker.leg += 1
    first = walker.leg * DRAWS
    for attempt in range(LEG_TRIES):
        # The goals of all tries follow the numbers that are drawn once.
        chances = first + 4 + 3 * attempt
        zone = zone_for(world, w, PEOPLE, uniform(seed, WALKER_STREAM, p, chances))
        share_x = uniform(seed, WALKER_STREAM, p, chances + 1)
        share_y = uniform(seed, WALKER_STREAM, p, chances + 2)
        walker.to_x, walker.to_y = point_in(world.parking.lots.zones[zone], share_x, share_y)
        if not _is_leg_blocked(world, w, walker):
            break
        # Without a free way they stay, and look for one again after the rest that is drawn below.
        walker.to_x, walker.to_y = walker.x, walker.y
    faster = uniform(seed, WALKER_STREAM, p, first)
    walker.speed = lot.walker_slowest + faster * (lot.walker_fastest - lot.walker_slowest)
    walker.rest_ticks, walker.rest_at = 0, 0.0
    if uniform(seed, WALKER_STREAM, p, first + 1) < lot.walker_stops:
        dx, dy = walker.to_x - walker.x, walker.to_y - walker.y
        share = uniform(seed, WALKER_STREAM, p, first + 2)
        walker.rest_at = share * math.sqrt(dx * dx + dy * dy)
        chance = uniform(seed, WALKER_STREAM, p, first + 3)
        walker.rest_ticks = int(chance * (lot.walker_rest_ticks + 1))


@kernel
def _is_leg_blocked(world: World, w: int, walker: Record) -> bool:
    """Return whether a block or a wall stands on the straight way of a person. walker: WALKER."""
    mx, my = 0.5 * (walker.x + walker.to_x), 0.5 * (walker.y + walker.to_y)
    dx, dy = walker.to_x - walker.x, walker.to_y - walker.y
    half = 0.5 * math.sqrt(dx * dx + dy * dy)
    for block in world.parking.blocks[w]:
        if is_near_block(block, mx, my, half + walker.radius):
            box = box_of(grown(block_hull(block), walker.radius))
            if box_on_segment(box, walker.x, walker.y, walker.to_x, walker.to_y)[0] > 0.0:
                return True
    site = world.walls.sites[world.rules[w].course]
    way = Hull(mx, my, math.atan2(dy, dx), 0.0, half, walker.radius, 0)
    if not is_free_of_walls(world.walls, site, way):
        return True
    end = _square_around(walker.to_x, walker.to_y, walker.radius)
    return not is_free_of_walls(world.walls, site, end)


@kernel
def _is_free(world: World, w: int, x: float, y: float, radius: float) -> bool:
    """Return whether a disc touches no block and, as a square, no wall. All in metres."""
    for block in world.parking.blocks[w]:
        if is_near_block(block, x, y, radius):
            if is_disc_on_box(box_of(block_hull(block)), x, y, radius):
                return False
    site = world.walls.sites[world.rules[w].course]
    return is_outside_of_walls(world.walls, site, _square_around(x, y, radius))


@kernel
def _square_around(x: float, y: float, radius: float) -> Hull:
    """Return the square around a disc. All in metres."""
    return Hull(x, y, 0.0, 0.0, radius, radius, 0)


@kernel
def _touches(world: World, w: int, k: int, walker: Record) -> bool:
    """Return whether a person, as a disc, and a vehicle overlap. walker: WALKER."""
    body, vehicle = world.bodies[w, k], world.vehicles[w, k]
    dx, dy, near = walker.x - body.x, walker.y - body.y, reach_of(vehicle) + walker.radius
    if dx * dx + dy * dy >= near * near:
        return False
    for number in range(box_count(vehicle)):
        if is_disc_on_box(
            box_of(hull_of(vehicle, body, number)), walker.x, walker.y, walker.radius
        ):
            return True
    return False


@kernel
def _touches_any(world: World, w: int, walker: Record) -> bool:
    """Return whether a person, as a disc, and any vehicle overlap. walker: WALKER."""
    for k in range(world.bodies.shape[1]):
        if world.bodies[w, k].status != codes.ABSENT and _touches(world, w, k, walker):
            return True
    return False


@kernel
def is_disc_on_box(box: Box, x: float, y: float, radius: float) -> bool:
    """Return whether a disc and a box overlap. x, y, radius: of the disc [m]."""
    dx, dy = x - box.x, y - box.y
    ahead = max(abs(dx * box.cos + dy * box.sin) - box.half_length, 0.0)
    aside = max(abs(dy * box.cos - dx * box.sin) - box.half_width, 0.0)
    return bool(ahead * ahead + aside * aside < radius * radius)


@kernel
def _judge(world: World, w: int, k: int, p: int) -> None:
    """Judge a touch: a hit, or a person who walked into a standing vehicle; each counts once."""
    body, parker = world.bodies[w, k], world.parking.parkers[w, k]
    walker = world.parking.walkers[w, p]
    is_new, is_hit = (walker.touching >> k) & 1 == 0, (walker.hit >> k) & 1 == 1
    walker.touching |= 1 << k
    if abs(body.speed) < STANDING:
        parker.walked_into += is_new
        return
    if not is_hit:
        walker.hit |= 1 << k
        report(world, w, codes.EVENT_HIT_PERSON, k, p, round(abs(body.speed) * 1000.0))
    parker.touched = codes.PERSON
    if world.rules[w].wall_contact == codes.RETIRE:
        retire(world, w, k, codes.HIT_PERSON)
