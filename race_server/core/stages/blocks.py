"""Blocks: the boxes of what stands in a car park, and how far vehicles are from them.

A vehicle among many blocks touches none of them most of the time. So it is measured once how far
it is from all blocks at least, and none is looked at again before it has moved that far.
"""

import math
from typing import NamedTuple

from race_server.core import codes
from race_server.core.kernels.boxes import Hull, box_count, box_of, hull_of, reach_of
from race_server.core.kernels.contacts import gap_between
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.state import Record, Records

# Blocks farther away [m] are not measured: no vehicle drives farther until the next measurement
# often enough for a larger room to pay.
FARTHEST = 0.5
# Room for the rounding of all that is computed [m].
MARGIN = 1e-6


class Standing(NamedTuple):
    """What stands in one world, and how far its vehicles are from that."""

    blocks: Records  # (B,) BLOCK
    rooms: Records  # (K,) ROOM, none where there are no blocks


@kernel
def block_hull(block: Record) -> Hull:
    """Return the box of a block. block: BLOCK."""
    return Hull(block.x, block.y, block.heading, 0.0, block.half_length, block.half_width, 0)


@kernel
def is_near_block(block: Record, x: float, y: float, reach: float) -> bool:
    """Return whether a block is there and comes within `reach` [m] of a place [m]."""
    if block.kind == codes.NOTHING:
        return False
    dx, dy, near = block.x - x, block.y - y, reach + block.half_length + block.half_width
    return bool(dx * dx + dy * dy < near * near)


@kernel
def is_own_block(vehicle: Record, k: int, bodies: int, number: int) -> bool:
    """Return whether a block is a box of vehicle k itself, see `lots.BLOCK`.

    vehicle: VEHICLE; bodies: how many there are; number: of the block.
    """
    return bool(number % bodies == k and number < bodies * box_count(vehicle))


@kernel
def forget_rooms(rooms: Records) -> None:
    """Let every vehicle of one world be measured again: blocks may be elsewhere. rooms: (K,)."""
    for k in range(len(rooms)):
        rooms[k].room = 0.0


@kernel
def may_touch_blocks(
    body: Record, vehicle: Record, k: int, bodies: int, standing: Standing
) -> bool:
    """Return whether a box of vehicle k may touch a block; where it does not, none is touched.

    body: BODY; vehicle: VEHICLE; bodies: how many there are. Room that is used up is measured
    again.
    """
    room = standing.rooms[k]
    if room.room > 0.0 and _moved_since(body, vehicle, room) < room.room:
        return False
    _measure_room(body, vehicle, k, bodies, standing.blocks, room)
    return bool(room.room <= 0.0)


@kernel
def _moved_since(body: Record, vehicle: Record, room: Record) -> float:
    """Return a distance [m] that no point of a vehicle has moved beyond since it was measured.

    body: BODY; vehicle: VEHICLE; room: ROOM. A point moves with the centre of gravity, and by its
    lever times the turn of each part between the two; no lever is longer than the vehicle's reach.
    """
    turned = abs(body.heading - room.heading)
    for number in range(vehicle.trailer_count):
        turned += abs(body.trailers[number].heading - room.trailers[number])
    return abs(body.x - room.x) + abs(body.y - room.y) + turned * reach_of(vehicle)


@large_kernel
def _measure_room(
    body: Record, vehicle: Record, k: int, bodies: int, blocks: Records, room: Record
) -> None:
    """Measure how far a vehicle is from all blocks at least, up to `FARTHEST`; see above."""
    least = FARTHEST
    for number in range(box_count(vehicle)):
        box = box_of(hull_of(vehicle, body, number))
        around = math.sqrt(box.half_length * box.half_length + box.half_width * box.half_width)
        for b in range(len(blocks)):
            if is_near_block(blocks[b], box.x, box.y, around + least):
                if not is_own_block(vehicle, k, bodies, b):
                    least = min(least, gap_between(box, box_of(block_hull(blocks[b]))))
    room.x, room.y, room.heading, room.room = body.x, body.y, body.heading, least - MARGIN
    for number in range(vehicle.trailer_count):
        room.trailers[number] = body.trailers[number].heading
