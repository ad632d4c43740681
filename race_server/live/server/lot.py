"""What spectators and drivers are sent of a car park."""

from collections.abc import Mapping
from types import MappingProxyType

import numpy as np

from race_server.core import codes
from race_server.core.parking_order import own_blocks_of
from race_server.core.state import Floats
from race_server.live.local_drivers import order_for
from race_server.net.wire.parking import BLOCK, GOAL, WALKER, LotFrame, OrderFrame, Rows, WayFrame
from race_server.session.seats import Seat
from race_server.session.session import Session

NO_WAYS: Mapping[int, Floats] = MappingProxyType({})


def order_frame_of(session: Session, seat: Seat) -> OrderFrame:
    """Return the order of a seat as it is sent."""
    return OrderFrame(session.epoch, seat.orders, order_for(session, seat.number))


def lot_of(session: Session, ways: Mapping[int, Floats] = NO_WAYS) -> LotFrame:
    """Return what was drawn for this round; vehicles of the session are in the snapshot.

    ways: planned by drivers of the server, by seat, (N, 2) [m].
    """
    parking, statuses = session.world.parking, session.world.bodies["status"][0]
    seats = np.flatnonzero((statuses != codes.ABSENT) & (parking.parkers["length"][0] > 0.0))
    goals = np.zeros(len(seats), GOAL)
    for name in ("x", "y", "heading", "length", "width", "slot"):
        goals[name] = parking.parkers[name][0, seats]
    goals["seat"] = seats
    own = own_blocks_of(session.world, 0, range(len(statuses)))
    standing = np.delete(parking.blocks[0], own)
    standing = standing[standing["kind"] != codes.NOTHING]
    blocks = np.zeros(len(standing), BLOCK)
    for name in ("x", "y", "heading", "kind"):
        blocks[name] = standing[name]
    blocks["length"], blocks["width"] = 2.0 * standing["half_length"], 2.0 * standing["half_width"]
    planned = tuple(WayFrame(seat, points) for seat, points in ways.items())
    return LotFrame(session.epoch, session.tick, goals, blocks, planned)


def walkers_of(session: Session) -> Rows:
    """Return the people (WALKER) who walk there."""
    there = session.world.parking.walkers[0]
    there = there[there["radius"] > 0.0]
    walkers = np.zeros(len(there), WALKER)
    for name in ("x", "y", "radius"):
        walkers[name] = there[name]
    return walkers
