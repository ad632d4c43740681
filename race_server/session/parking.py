"""What a session knows of a car park: slots that a vehicle may be sent to, and how all fare."""

import math

from race_server.core.messages import Ending, Parking
from race_server.core.parking_order import ParkingOrder, order_of
from race_server.core.rules.parking import ending_of
from race_server.core.state import World
from race_server.errors import Reason, SeatError


def has_lot(world: World) -> bool:
    """Return whether vehicles of a session go to slots."""
    return world.parking.parkers.shape[1] > 0


def standing_orders_of(world: World) -> list[ParkingOrder]:
    """Return the order of each vehicle as its round begins; none where there is no car park."""
    return [order_of(world, 0, k) for k in range(world.parking.parkers.shape[1])]


def check_slot(world: World, kart: int, slot: int) -> None:
    """Do nothing for a slot that a vehicle can be sent to. slot: number, -1 for its own.

    Raises:
        SeatError: there is no car park or no such slot, or another vehicle has it.
    """
    if not has_lot(world):
        raise SeatError("there is no car park here; serve one with --lot", Reason.DECISION)
    count = int(world.parking.lots.lots[world.rules[0].course].slot_count)
    if slot >= count:
        known = f"choose 0 to {count - 1}, or -1" if count else "this car park has none: choose -1"
        raise SeatError(f"slot {slot} does not exist; {known}", Reason.DECISION)
    if slot < 0:
        return
    parkers = world.parking.parkers[0]
    if any(int(parkers[k].slot) == slot for k in range(len(parkers)) if k != kart):
        raise SeatError(f"slot {slot} is that of another vehicle", Reason.DECISION)
    if _is_taken(world, slot):
        raise SeatError(f"slot {slot} is taken: a vehicle stands there", Reason.DECISION)


def _is_taken(world: World, slot: int) -> bool:
    """Return whether the middle of a block lies in a slot."""
    lots = world.parking.lots
    place = lots.slots[lots.lots[world.rules[0].course].slot_start + slot]
    cos, sin = math.cos(place.heading), math.sin(place.heading)
    for block in world.parking.blocks[0]:
        dx, dy = block.x - place.x, block.y - place.y
        along, across = abs(dx * cos + dy * sin), abs(dy * cos - dx * sin)
        if block.kind and along < 0.5 * place.length and across < 0.5 * place.width:
            return True
    return False


def send_to(world: World, kart: int, slot: int) -> None:
    """Give a vehicle another slot; -1 leaves it the one that it has."""
    lots = world.parking.lots
    if not has_lot(world):
        return
    lot = lots.lots[world.rules[0].course]
    if not 0 <= slot < lot.slot_count:
        return
    parker, place = world.parking.parkers[0, kart], lots.slots[lot.slot_start + slot]
    parker.slot, parker.held_ticks = slot, 0
    for name in ("x", "y", "heading", "length", "width"):
        parker[name] = place[name]


def figures_of(world: World, kart: int) -> Parking | None:
    """Return how a vehicle fares on its way to its slot; None where there is no car park."""
    if not has_lot(world):
        return None
    parker, body = world.parking.parkers[0, kart], world.bodies[0, kart]
    reason = int(world.racers[0, kart].retired_for)
    return Parking(
        ending=Ending(ending_of(int(body.status), reason, int(parker.touched))),
        slot=int(parker.slot),
        way=float(parker.way),
        reversed=float(parker["reversed"]),
        moves=int(parker.moves),
        walked_into=int(parker.walked_into),
    )
