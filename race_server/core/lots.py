"""Car parks as arrays: what is fixed about them, and what is drawn for one world.

A lot stands at the same site as a course of the same number, see `state.World`. Axis letters: W
worlds, K vehicles, B blocks, P people, C sites, S slots, Z zones. In a race the axes K, B and P
have the length zero: a race pays nothing for them, and its digest does not change.
"""

from typing import NamedTuple

import numpy as np

from race_server.core.records import Records, fields_of, record_of
from race_server.core.vehicles import TRAILERS

# One vehicle's slot and how it fares. Lengths [m], angles [rad], speeds [m/s].
_PARKER = fields_of(
    # The slot: its middle, the heading of a vehicle parked in it, its size.
    "x y heading length width "
    # How well the middle of the body has to stand in it, each 0 where it does not matter:
    # distance, offsets along and across, difference of headings, speed.
    "within along across turn still "
    # Farther from the slot than this the vehicle has left; 0: it never does.
    "leave "
    # So far: the way driven, forward and back, and the part of it in reverse.
    "way reversed",
    # `fits`: 1 where the body must lie inside the slot; `slot`: number of the slot, -1 where
    # there is none; `gear`: the sign of the last motion; `moves`: changes of it; `touched`:
    # what it ran into, a RayHit; `walked_into`: people who ran into it while it stood.
    "fits hold_ticks slot held_ticks parked_tick gear moves touched walked_into",
)
# What came later, for trailers and starts: in no digest, since recordings hold digests. `hitch`:
# the largest angle at any hitch, 0 where it does not matter; `last`: 1 where the last trailer's box
# is judged, and not the vehicle's; `began`: number of the slot where it started, -1 for none.
PARKER = record_of([*_PARKER, *fields_of("hitch", "last began")])
# An obstacle of one world: drawn for a round, or a vehicle that stands. `kind`: RayHit; NOTHING
# where there is none. Block k is the body of vehicle k once it has parked or crashed, block K + k
# its first trailer, and so on, as far as any vehicle of the world has one.
BLOCK = record_of(fields_of("x y heading half_length half_width", "kind"))
# How far a vehicle was from all blocks [m], at least, when it was at this place and its trailers
# had these headings; see `stages/blocks.py`. Derived from the world: in no digest.
ROOM = record_of([*fields_of("x y heading room", ""), ("trailers", np.float64, (TRAILERS,))])
# A person who walks from place to place. `rest_at`: way left [m] of this leg where a stop begins;
# `against`: 1 + number of the last vehicle that they touched in the tick before, 0 for none.
_WALKER = fields_of("x y to_x to_y speed radius rest_at", "leg rest_ticks against")
# What came later, in no digest, with a bit for each vehicle: which they have touched since the tick
# before, and which of these have hit them.
WALKER = record_of([*_WALKER, *fields_of("", "touching hit")])

# What is fixed about one lot. Shares are of 1, sizes in metres, times in ticks.
LOT = record_of(
    fields_of(
        # Of slots that no vehicle goes to, this share holds a vehicle.
        "taken taken_length taken_width "
        "block_least block_most slot_length slot_width nearest farthest "
        "walker_slowest walker_fastest walker_radius walker_stops",
        # `from_slots`: 1 where vehicles start in slots, and not in zones.
        "slot_start slot_count zone_start zone_count blocks_least blocks_most walkers "
        "walker_rest_ticks from_slots",
    )
)
SLOT = record_of(fields_of("x y heading length width", ""))
# A rectangle of places, with a heading and how far from it one may be; `hitch`: how far from 0 the
# angles at the hitches of a vehicle that starts may be. `role`: see below.
ZONE = record_of(fields_of("x0 x1 y0 y1 heading spread hitch", "role"))

# What a zone is for.
START, GOAL, BLOCKS, PEOPLE = range(4)
ROLES = {"start": START, "goal": GOAL, "blocks": BLOCKS, "people": PEOPLE}


class Lots(NamedTuple):
    """The lots of a batch, one behind the other; `lots[c]` says where each begins."""

    lots: Records  # (C,) LOT
    slots: Records  # (S,) SLOT
    zones: Records  # (Z,) ZONE


class CarPark(NamedTuple):
    """What each world of a batch has of a car park."""

    lots: Lots
    parkers: Records  # (W, K) PARKER
    blocks: Records  # (W, B) BLOCK
    walkers: Records  # (W, P) WALKER
    rooms: Records  # (W, K) ROOM


def empty_parking(worlds: int, vehicles: int, blocks: int, people: int, lots: Lots) -> CarPark:
    """Return the car parks of `worlds` worlds, in which nothing stands yet."""
    return CarPark(
        lots=lots,
        parkers=np.zeros((worlds, vehicles), PARKER),
        blocks=np.zeros((worlds, blocks), BLOCK),
        walkers=np.zeros((worlds, people), WALKER),
        rooms=np.zeros((worlds, vehicles), ROOM),
    )


def part_of_parking(parking: CarPark, cut: slice) -> CarPark:
    """Return some of the worlds as a view that shares their memory."""
    return parking._replace(
        parkers=parking.parkers[cut],
        blocks=parking.blocks[cut],
        walkers=parking.walkers[cut],
        rooms=parking.rooms[cut],
    )


def bytes_of(parking: CarPark, index: int) -> list[bytes]:
    """Return what the digest of one world takes of its car park; nothing in a race."""
    return [
        _first_of(parking.parkers[index], len(_PARKER)),
        parking.blocks[index].tobytes(),
        _first_of(parking.walkers[index], len(_WALKER)),
    ]


def _first_of(rows: Records, count: int) -> bytes:
    """Return the first fields of records, as bytes."""
    numbers = np.ascontiguousarray(rows).view(np.int64)
    return numbers.reshape(-1, rows.dtype.itemsize // 8)[:, :count].tobytes()
