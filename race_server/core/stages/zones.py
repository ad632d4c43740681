"""Zones of a car park: where vehicles begin, slots and blocks are drawn, and people walk."""

from race_server.core.kernels.jit import kernel
from race_server.core.state import Record, World


@kernel
def zone_for(world: World, w: int, role: int, chance: float) -> int:
    """Return the number of one of the lot's zones of a role; -1 where it has none.

    chance: in [0, 1), decides between several.
    """
    lots = world.parking.lots
    lot = lots.lots[world.rules[w].course]
    count = 0
    for zone in range(lot.zone_start, lot.zone_start + lot.zone_count):
        count += 1 if lots.zones[zone].role == role else 0
    wanted = int(chance * count)
    for zone in range(lot.zone_start, lot.zone_start + lot.zone_count):
        if lots.zones[zone].role == role:
            if wanted == 0:
                return zone
            wanted -= 1
    return -1


@kernel
def point_in(zone: Record, share_x: float, share_y: float) -> tuple[float, float]:
    """Return a point of a zone [m]. share_x, share_y: in [0, 1)."""
    return zone.x0 + share_x * (zone.x1 - zone.x0), zone.y0 + share_y * (zone.y1 - zone.y0)
