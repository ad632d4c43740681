"""What a session knows of a car park: slots that a vehicle may be sent to, and how all fare."""

import math

import numpy as np

from race_server.core import codes
from race_server.core.driven import races_first
from race_server.core.messages import Ending, Parking
from race_server.core.parking_order import ParkingOrder, order_of
from race_server.core.rules.parking import ending_of
from race_server.core.stages.blocks import is_near_block
from race_server.core.state import World
from race_server.errors import Reason, SeatError
from race_server.scenario.lot.faults import TOUCH
from race_server.scenario.lot.footprint import Footprint

# In place of the number of a slot: the one that a vehicle has, or none any more.
ITS_OWN, TO_NONE = -1, -2


def has_lot(world: World) -> bool:
    """Return whether vehicles of a session go to slots."""
    return world.parking.parkers.shape[1] > 0


def goes_to_slot(world: World, kart: int) -> bool:
    """Return whether a vehicle has a slot to go to."""
    return has_lot(world) and bool(world.parking.parkers[0, kart].length > 0.0)


def standing_orders_of(world: World) -> list[ParkingOrder]:
    """Return the order of each vehicle as its round begins; none where there is no car park."""
    return [order_of(world, 0, k) for k in range(world.parking.parkers.shape[1])]


def parks_from_start(world: World) -> bool:
    """Return whether every vehicle goes to a slot from the start on, as in a car park."""
    return has_lot(world) and not races_first(world)


def parks_after_race(world: World) -> bool:
    """Return whether vehicles race first, and go to a slot once they are asked to."""
    return has_lot(world) and races_first(world)


def check_slot(world: World, kart: int, slot: int) -> None:
    """Do nothing for a slot that a vehicle can be sent to. slot: number, -1 for its own.

    Raises:
        SeatError: there is no car park or no such slot, or another vehicle has it.
    """
    if not has_lot(world):
        raise SeatError("there is no car park here; serve one with --lot", Reason.DECISION)
    count = int(world.parking.lots.lots[world.rules[0].course].slot_count)
    if not ITS_OWN <= slot < count:
        known = f"choose 0 to {count - 1}, or -1" if count else "this car park has none: choose -1"
        raise SeatError(f"slot {slot} does not exist; {known}", Reason.DECISION)
    if slot < 0 and not goes_to_slot(world, kart):
        slot = free_slot(world, kart)
        if slot < 0:
            raise SeatError("no slot is free here", Reason.DECISION)
    if slot < 0:
        return
    if _is_promised(world, slot, kart):
        raise SeatError(f"slot {slot} is that of another vehicle", Reason.DECISION)
    if _is_taken(world, slot):
        raise SeatError(f"slot {slot} is taken: a vehicle stands there", Reason.DECISION)


def free_slot(world: World, kart: int) -> int:
    """Return the first slot that a vehicle can be sent to, -1 where there is none."""
    count = int(world.parking.lots.lots[world.rules[0].course].slot_count)
    free = (s for s in range(count) if not (_is_promised(world, s, kart) or _is_taken(world, s)))
    return next(free, -1)


def _is_promised(world: World, slot: int, kart: int) -> bool:
    """Return whether another vehicle than this one goes to a slot, or is parked there."""
    parkers, statuses = world.parking.parkers[0], world.bodies["status"][0]
    is_there = ~np.isin(statuses, (codes.ABSENT, codes.RETIRED))
    goes = is_there & (parkers["length"] > 0.0) & (parkers["slot"] == slot)
    return bool(np.delete(goes, kart).any())


def _is_taken(world: World, slot: int) -> bool:
    """Return whether a block reaches into a slot, by more than what stands beside one may."""
    lots = world.parking.lots
    row = lots.slots[lots.lots[world.rules[0].course].slot_start + slot]
    place = Footprint(row.x, row.y, row.heading, row.length, row.width).grown(-TOUCH)
    near = 0.5 * math.hypot(row.length, row.width)
    for block in world.parking.blocks[0]:
        if is_near_block(block, row.x, row.y, near):
            size = 2.0 * block.half_length, 2.0 * block.half_width
            if place.overlaps(Footprint(block.x, block.y, block.heading, *size)):
                return True
    return False


def send_to(world: World, kart: int, slot: int) -> None:
    """Give a vehicle another slot.

    ITS_OWN leaves it the one that it has, or gives it the first free; TO_NONE takes it away.
    """
    lots = world.parking.lots
    if not has_lot(world):
        return
    if slot == TO_NONE:
        world.parking.parkers[0, kart].length = 0.0
        return
    if slot < 0 and not goes_to_slot(world, kart):
        slot = free_slot(world, kart)
    lot = lots.lots[world.rules[0].course]
    if not 0 <= slot < lot.slot_count:
        return
    parker, place = world.parking.parkers[0, kart], lots.slots[lot.slot_start + slot]
    parker.slot, parker.held_ticks = slot, 0
    for name in ("x", "y", "heading", "length", "width"):
        parker[name] = place[name]


def figures_of(world: World, kart: int) -> Parking | None:
    """Return how a vehicle fares on its way to its slot; None where it goes to none."""
    if not goes_to_slot(world, kart):
        return None
    parker, body = world.parking.parkers[0, kart], world.bodies[0, kart]
    status, reason = int(body.status), int(world.racers[0, kart].retired_for)
    is_open = status == codes.FINISHED and int(parker.parked_tick) == 0 and races_first(world)
    return Parking(
        ending=Ending.OPEN if is_open else Ending(ending_of(status, reason, int(parker.touched))),
        slot=int(parker.slot),
        way=float(parker.way),
        reversed=float(parker["reversed"]),
        moves=int(parker.moves),
        walked_into=int(parker.walked_into),
    )
