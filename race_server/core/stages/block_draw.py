"""Blocks of a car park, drawn clear of walls, of slots and of each other."""

import math

from race_server.core import codes
from race_server.core.kernels.boxes import Hull, box_of, grown
from race_server.core.kernels.contacts import box_on_box
from race_server.core.kernels.jit import kernel
from race_server.core.kernels.rng import BLOCK_STREAM, uniform
from race_server.core.lots import BLOCKS
from race_server.core.stages.blocks import block_hull
from race_server.core.stages.wall_contacts import is_outside_of_walls
from race_server.core.stages.zones import point_in, zone_for
from race_server.core.state import Record, World

# Something is drawn at most this many times; then the last draw stays.
TRIES = 32
# Numbers drawn for each try.
DRAWS = 8
# Room around a slot [m].
SLOT_ROOM = 0.6


@kernel
def slot_hull(parker: Record, room: float) -> Hull:
    """Return the rectangle of a vehicle's slot, with `room` [m] around it. parker: PARKER."""
    return _grown_slot(parker.x, parker.y, parker.heading, parker.length, parker.width, room)


@kernel
def _hull_of_start(world: World, w: int, k: int) -> Hull:
    """Return the rectangle of the slot that a vehicle starts in, with room around it."""
    lots = world.parking.lots
    number = lots.lots[world.rules[w].course].slot_start + world.parking.parkers[w, k].began
    slot = lots.slots[number]
    return _grown_slot(slot.x, slot.y, slot.heading, slot.length, slot.width, SLOT_ROOM)


@kernel
def _grown_slot(
    x: float, y: float, heading: float, length: float, width: float, room: float
) -> Hull:
    return grown(Hull(x, y, heading, 0.0, 0.5 * length, 0.5 * width, 0), room)


@kernel
def overlap(one: Hull, other: Hull) -> bool:
    """Return whether two rectangles overlap."""
    dx, dy = one.x - other.x, one.y - other.y
    near = one.half_length + one.half_width + other.half_length + other.half_width
    near += abs(one.offset) + abs(other.offset)
    if dx * dx + dy * dy >= near * near:
        return False
    return bool(box_on_box(box_of(one), box_of(other))[0] > 0.0)


@kernel
def draw_blocks(world: World, w: int, first: int) -> None:
    """Draw the loose blocks of one world, clear of slots and of each other.

    first: number of the first block to use.
    """
    parking, seed = world.parking, world.races[w].seed
    lot = parking.lots.lots[world.rules[w].course]
    more = lot.blocks_most - lot.blocks_least + 1
    wanted = lot.blocks_least + int(uniform(seed, BLOCK_STREAM, 0, 0) * more)
    for number in range(first, min(first + wanted, parking.blocks.shape[1])):
        _draw_block(world, w, number)


@kernel
def _draw_block(world: World, w: int, number: int) -> None:
    """Draw one block; one that finds no room in all tries stays away."""
    parking, seed = world.parking, world.races[w].seed
    lot = parking.lots.lots[world.rules[w].course]
    block = parking.blocks[w, number]
    for attempt in range(TRIES):
        first = attempt * DRAWS
        zone = zone_for(world, w, BLOCKS, uniform(seed, BLOCK_STREAM, number, first))
        if zone < 0:
            return
        share_x = uniform(seed, BLOCK_STREAM, number, first + 1)
        share_y = uniform(seed, BLOCK_STREAM, number, first + 2)
        block.x, block.y = point_in(parking.lots.zones[zone], share_x, share_y)
        block.heading = (2.0 * uniform(seed, BLOCK_STREAM, number, first + 3) - 1.0) * math.pi
        span = 0.5 * (lot.block_most - lot.block_least)
        least = 0.5 * lot.block_least
        block.half_length = least + span * uniform(seed, BLOCK_STREAM, number, first + 4)
        block.half_width = least + span * uniform(seed, BLOCK_STREAM, number, first + 5)
        if _has_block_room(world, w, number):
            block.kind = codes.OBSTACLE
            return


@kernel
def _has_block_room(world: World, w: int, number: int) -> bool:
    """Return whether a block overlaps no wall, no slot that is taken and no block before it."""
    parking, mine = world.parking, block_hull(world.parking.blocks[w, number])
    for k in range(parking.parkers.shape[1]):
        parker = parking.parkers[w, k]
        if overlap(mine, slot_hull(parker, SLOT_ROOM)):
            return False
        if parker.began >= 0 and overlap(mine, _hull_of_start(world, w, k)):
            return False
    for other in range(number):
        block = parking.blocks[w, other]
        if block.kind != codes.NOTHING and overlap(mine, block_hull(block)):
            return False
    return is_outside_of_walls(world.walls, world.walls.sites[world.rules[w].course], mine)
