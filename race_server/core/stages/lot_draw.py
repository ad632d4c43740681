"""The start in a car park: slots, blocks, people and vehicles, drawn from the seed of a world.

Each use of chance has a stream and counters for itself, so that one more block changes nothing
else. What would stand in a wall, or in something drawn before it, is drawn again.
"""

from race_server.core import codes
from race_server.core.kernels.boxes import (
    Hull,
    box_count,
    grown,
    hull_of,
    most_boxes,
)
from race_server.core.kernels.geometry import cos_sin, wrap_angle
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.rng import (
    PLACE_STREAM,
    SLOT_STREAM,
    TAKEN_STREAM,
    uniform,
)
from race_server.core.kernels.trailers import place_in_line, straighten
from race_server.core.lots import GOAL, START
from race_server.core.stages.block_draw import (
    DRAWS,
    SLOT_ROOM,
    TRIES,
    draw_blocks,
    overlap,
    slot_hull,
)
from race_server.core.stages.blocks import block_hull, is_near_block
from race_server.core.stages.people import place_walker
from race_server.core.stages.wall_contacts import is_outside_of_walls
from race_server.core.stages.zones import point_in, zone_for
from race_server.core.state import Record, World
from race_server.core.vehicles import TRAILERS

# Room around a vehicle at its start [m].
START_ROOM = 0.3


@large_kernel
def draw_lot(world: World, w: int) -> None:
    """Draw the slots, blocks, starts and people of one world. Its seed decides all of them."""
    parking = world.parking
    for b in range(parking.blocks.shape[1]):
        _clear_block(parking.blocks[w, b])
    for k in range(parking.parkers.shape[1]):
        _draw_slot(world, w, k)
    for k in range(parking.parkers.shape[1]):
        _draw_first_slot(world, w, k)
    # The first blocks are the boxes of the vehicles themselves, once they stand.
    own = parking.parkers.shape[1] * most_boxes(world.vehicles[w])
    following = _take_slots(world, w, own)
    draw_blocks(world, w, following)
    for k in range(parking.parkers.shape[1]):
        if world.bodies[w, k].status != codes.ABSENT:
            _draw_start(world, w, k)
    for p in range(parking.walkers.shape[1]):
        place_walker(world, w, p)


@kernel
def _clear_block(block: Record) -> None:
    """Forget a block of the round before: the digest is one of this round alone."""
    block.x = block.y = block.heading = block.half_length = block.half_width = 0.0
    block.kind = codes.NOTHING


@kernel
def _draw_slot(world: World, w: int, k: int) -> None:
    """Draw the slot of a vehicle that no vehicle before it has, out of the lot's or in a zone."""
    lots, seed, parker = world.parking.lots, world.races[w].seed, world.parking.parkers[w, k]
    lot = lots.lots[world.rules[w].course]
    for attempt in range(TRIES):
        first = attempt * DRAWS
        chance = uniform(seed, SLOT_STREAM, k, first)
        if lot.slot_count > 0:
            parker.slot = _free_slot(world, w, k, chance)
            slot = lots.slots[lot.slot_start + parker.slot]
            parker.x, parker.y, parker.heading = slot.x, slot.y, slot.heading
            parker.length, parker.width = slot.length, slot.width
        else:
            zone = lots.zones[zone_for(world, w, GOAL, chance)]
            share_x = uniform(seed, SLOT_STREAM, k, first + 1)
            share_y = uniform(seed, SLOT_STREAM, k, first + 2)
            turn = 2.0 * uniform(seed, SLOT_STREAM, k, first + 3) - 1.0
            parker.slot = -1
            parker.x, parker.y = point_in(zone, share_x, share_y)
            parker.heading = zone.heading + turn * zone.spread
            parker.length, parker.width = lot.slot_length, lot.slot_width
        if _is_slot_free(world, w, k):
            return


@kernel
def _free_slot(world: World, w: int, k: int, chance: float) -> int:
    """Return one of the lot's slots that no vehicle before vehicle k has. chance: in [0, 1)."""
    lot = world.parking.lots.lots[world.rules[w].course]
    parkers = world.parking.parkers[w]
    wanted = int(chance * (lot.slot_count - k))
    for number in range(lot.slot_count):
        is_free = True
        for other in range(k):
            is_free = is_free and parkers[other].slot != number
        if is_free:
            if wanted == 0:
                return number
            wanted -= 1
    return -1


@kernel
def _draw_first_slot(world: World, w: int, k: int) -> None:
    """Draw the slot that a vehicle starts in, where the lot wants that: of no other vehicle."""
    parking, seed, parker = world.parking, world.races[w].seed, world.parking.parkers[w, k]
    lot = parking.lots.lots[world.rules[w].course]
    parker.began = -1
    if not lot.from_slots:
        return
    for attempt in range(TRIES):
        chance = uniform(seed, PLACE_STREAM, k, attempt * DRAWS)
        # Each vehicle has a goal, and those before it a start as well.
        wanted = int(chance * (lot.slot_count - parking.parkers.shape[1] - k))
        for number in range(lot.slot_count):
            if _is_wanted(world, w, k, number):
                continue
            if wanted == 0:
                parker.began = number
                break
            wanted -= 1
        slot = parking.lots.slots[lot.slot_start + parker.began]
        if _is_far_enough(world, w, k, slot.x, slot.y):
            return


@kernel
def _is_wanted(world: World, w: int, k: int, number: int) -> bool:
    """Return whether a slot is the goal of any vehicle, or the start of one before vehicle k."""
    parkers = world.parking.parkers[w]
    for other in range(len(parkers)):
        if parkers[other].slot == number or (other < k and parkers[other].began == number):
            return True
    return False


@kernel
def _is_slot_free(world: World, w: int, k: int) -> bool:
    """Return whether the slot of a vehicle overlaps none before it, and no wall if drawn freely."""
    parkers = world.parking.parkers[w]
    if parkers[k].slot >= 0:
        return True
    mine = slot_hull(parkers[k], 0.0)
    for other in range(k):
        if overlap(mine, slot_hull(parkers[other], SLOT_ROOM)):
            return False
    return is_outside_of_walls(world.walls, world.walls.sites[world.rules[w].course], mine)


@kernel
def _take_slots(world: World, w: int, first: int) -> int:
    """Put vehicles into slots to or from which none drives; return the next free block.

    first: number of the first block to use.
    """
    parking, seed = world.parking, world.races[w].seed
    lot = parking.lots.lots[world.rules[w].course]
    following = first
    for number in range(lot.slot_count):
        is_wanted = _is_wanted(world, w, parking.parkers.shape[1], number)
        is_taken = uniform(seed, TAKEN_STREAM, number, 0) < lot.taken
        if is_wanted or not is_taken or following >= parking.blocks.shape[1]:
            continue
        slot, block = parking.lots.slots[lot.slot_start + number], parking.blocks[w, following]
        block.x, block.y, block.heading = slot.x, slot.y, slot.heading
        block.half_length, block.half_width = 0.5 * lot.taken_length, 0.5 * lot.taken_width
        block.kind = codes.KART_HIT
        following += 1
    return following


@kernel
def _draw_start(world: World, w: int, k: int) -> None:
    """Put a vehicle into one of the lot's start zones, clear of all that stands there.

    Where vehicles start in slots, put it straight into the middle of the one that it drew.
    """
    seed, began = world.races[w].seed, world.parking.parkers[w, k].began
    if began >= 0:
        lots = world.parking.lots
        slot = lots.slots[lots.lots[world.rules[w].course].slot_start + began]
        put_body(world, w, k, slot.x, slot.y, slot.heading)
        return
    for attempt in range(TRIES):
        first = attempt * DRAWS
        number = zone_for(world, w, START, uniform(seed, PLACE_STREAM, k, first))
        if number < 0:
            return
        zone = world.parking.lots.zones[number]
        share_x = uniform(seed, PLACE_STREAM, k, first + 1)
        share_y = uniform(seed, PLACE_STREAM, k, first + 2)
        x, y = point_in(zone, share_x, share_y)
        turn = 2.0 * uniform(seed, PLACE_STREAM, k, first + 3) - 1.0
        put_body(world, w, k, x, y, zone.heading + turn * zone.spread)
        for trailer in range(world.vehicles[w, k].trailer_count):
            bend = 2.0 * uniform(seed, PLACE_STREAM, k, first + 4 + trailer) - 1.0
            _bend(world.bodies[w, k], trailer, bend * zone.hitch)
        if _is_far_enough(world, w, k, x, y) and has_room(world, w, k, START_ROOM):
            return


@kernel
def put_body(world: World, w: int, k: int, x: float, y: float, heading: float) -> None:
    """Put a vehicle so that its middle is at (x, y) [m], with its trailers straight behind it.

    The middle is that of its body, or of the whole with trailers.
    """
    body, vehicle = world.bodies[w, k], world.vehicles[w, k]
    offset = vehicle.box_offset - place_in_line(vehicle, 0)
    cos, sin = cos_sin(heading)
    body.x, body.y, body.heading = x - offset * cos, y - offset * sin, heading
    straighten(body, vehicle)


@kernel
def _bend(body: Record, number: int, angle: float) -> None:
    """Turn a trailer, and with it those behind, to an angle [rad] at its hitch. body: BODY."""
    ahead = body.heading if number == 0 else body.trailers[number - 1].heading
    turn = wrap_angle(ahead - angle) - body.trailers[number].heading
    for behind in range(number, TRAILERS):
        body.trailers[behind].heading = wrap_angle(body.trailers[behind].heading + turn)


@kernel
def _is_far_enough(world: World, w: int, k: int, x: float, y: float) -> bool:
    """Return whether a start [m] is as far from the slot as the lot asks, and no farther."""
    parker = world.parking.parkers[w, k]
    lot = world.parking.lots.lots[world.rules[w].course]
    dx, dy = x - parker.x, y - parker.y
    square = dx * dx + dy * dy
    if square < lot.nearest * lot.nearest:
        return False
    return lot.farthest <= 0.0 or square < lot.farthest * lot.farthest


@kernel
def has_room(world: World, w: int, k: int, room: float) -> bool:
    """Return whether a vehicle, with `room` [m] around it, touches no wall, block or vehicle.

    Of the vehicles only those with smaller numbers count: the others are not placed yet.
    """
    for number in range(box_count(world.vehicles[w, k])):
        mine = grown(hull_of(world.vehicles[w, k], world.bodies[w, k], number), room)
        if not _has_box_room(world, w, k, mine):
            return False
    return True


@kernel
def _has_box_room(world: World, w: int, k: int, mine: Hull) -> bool:
    """Return whether a box of vehicle k touches no wall, block or vehicle before it."""
    if not is_outside_of_walls(world.walls, world.walls.sites[world.rules[w].course], mine):
        return False
    reach = mine.half_length + mine.half_width + abs(mine.offset)
    for block in world.parking.blocks[w]:
        if is_near_block(block, mine.x, mine.y, reach) and overlap(mine, block_hull(block)):
            return False
    for other in range(k):
        rival, vehicle = world.bodies[w, other], world.vehicles[w, other]
        if rival.status != codes.ABSENT:
            for number in range(box_count(vehicle)):
                if overlap(mine, hull_of(vehicle, rival, number)):
                    return False
    return True
