"""Car parks packed into flat arrays for the kernels."""

from collections.abc import Sequence

import numpy as np

from race_server.core.clock import ticks_of
from race_server.core.lots import LOT, ROLES, SLOT, ZONE, CarPark, Lots, empty_parking
from race_server.core.records import Records
from race_server.scenario.track.lot import Lot


def pack_lots(lots: Sequence[Lot | None]) -> Lots:
    """Return the lots behind one another; lot c of a race's rules is `lots[c]`."""
    headers = np.zeros(len(lots), LOT)
    slots, zones = [np.zeros(0, SLOT)], [np.zeros(0, ZONE)]
    for header, lot in zip(headers, lots, strict=True):
        header.slot_start, header.zone_start = sum(map(len, slots)), sum(map(len, zones))
        if lot is not None:
            header.slot_count, header.zone_count = len(lot.slots), len(lot.zones)
            slots.append(_slots_of(lot))
            zones.append(_zones_of(lot))
            _fill_header(header, lot)
    return Lots(headers, np.concatenate(slots), np.concatenate(zones))


def make_parking(lots: Sequence[Lot | None], worlds: int, karts: int, boxes: int = 1) -> CarPark:
    """Return the car parks of `worlds` worlds that may be at any of these lots, still empty.

    boxes: that a vehicle is made of, at most.
    """
    real = [lot for lot in lots if lot is not None]
    if not real:
        return empty_parking(worlds, 0, 0, 0, pack_lots(lots))
    blocks = karts * boxes + max(map(_count_blocks, real))
    people = max(lot.people.count for lot in real)
    return empty_parking(worlds, karts, blocks, people, pack_lots(lots))


def _count_blocks(lot: Lot) -> int:
    """Return how many blocks a lot may need besides the vehicles that drive there."""
    return lot.blocks.count[1] + (len(lot.slots) if lot.taken.share > 0.0 else 0)


def _fill_header(header: Records, lot: Lot) -> None:
    header["taken"] = lot.taken.share
    header["taken_length"], header["taken_width"] = lot.taken.length, lot.taken.width
    header["blocks_least"], header["blocks_most"] = lot.blocks.count
    header["block_least"], header["block_most"] = lot.blocks.side
    header["slot_length"], header["slot_width"] = lot.slot_size
    header["nearest"], header["farthest"] = lot.distance
    header["from_slots"] = lot.from_slots
    header["walkers"], header["walker_radius"] = lot.people.count, lot.people.radius
    header["walker_slowest"], header["walker_fastest"] = lot.people.speed
    header["walker_stops"], header["walker_rest_ticks"] = (
        lot.people.stops,
        ticks_of(lot.people.rest_s),
    )


def _slots_of(lot: Lot) -> Records:
    slots = np.zeros(len(lot.slots), SLOT)
    for column, name in enumerate(("x", "y", "heading", "length", "width")):
        slots[name] = lot.slots[:, column]
    return slots


def _zones_of(lot: Lot) -> Records:
    zones = np.zeros(len(lot.zones), ZONE)
    for zone, row in zip(lot.zones, zones, strict=True):
        row["x0"], row["x1"] = zone.x
        row["y0"], row["y1"] = zone.y
        row["heading"], row["spread"], row["hitch"] = zone.heading, zone.spread, zone.hitch
        row["role"] = ROLES[zone.role]
    return zones
