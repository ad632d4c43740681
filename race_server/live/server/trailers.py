"""What spectators are sent of trailers."""

import numpy as np

from race_server.core import codes
from race_server.net.wire.parking import TRAILER, TRAILER_NAMES, Rows
from race_server.session.session import Session


def trailers_of(session: Session) -> Rows:
    """Return the boxes of all trailers (TRAILER); none where no vehicle has one."""
    world, rows = session.world, []
    for seat in np.flatnonzero(world.vehicles["trailer_count"][0]).tolist():
        body, vehicle = world.bodies[0, seat], session.scenario.vehicle_of(seat)
        if body.status == codes.ABSENT:
            continue
        headings = body.trailers["heading"].tolist()
        boxes = vehicle.boxes_at(body.x, body.y, body.heading, headings)[1:]
        rows += [
            (*box, trailer.limit, seat)
            for box, trailer in zip(boxes, vehicle.trailers, strict=True)
        ]
    trailers = np.zeros(len(rows), TRAILER)
    for name, column in zip(TRAILER_NAMES, zip(*rows, strict=True), strict=False):
        trailers[name] = column
    return trailers
