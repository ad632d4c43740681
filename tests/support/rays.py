"""The reader of rays: only the page reads them outside of tests."""

import struct

import numpy as np

from race_server.errors import WireError
from race_server.net.wire.rays import RAYS_ID, RaysFrame
from race_server.net.wire.strict import U16, U32, root_of

F32 = struct.Struct("<f")
MOST_RAYS = 2048
MOST_BYTES = 1 << 15


def decode_rays(data: bytes) -> RaysFrame:
    """Return the rays in a message.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, RAYS_ID, MOST_BYTES)
    x, y, heading, ahead, field, reach = (table.number(slot, F32) for slot in range(2, 8))
    vectors = []
    for slot in (8, 11, 12):
        first, count = table.vector(slot, F32.size, MOST_RAYS)
        vectors.append(np.frombuffer(data, "<f4", count, first))
    lidar, angles, radar = vectors
    first, count = table.vector(13, 1, MOST_RAYS)
    kinds = np.frombuffer(data, np.uint8, count, first)
    if not len(angles) == len(radar) == len(kinds):
        raise WireError("radar of more angles than ranges, or the other way round")
    return RaysFrame(
        tick=table.scalar(0, U32),
        seat=table.scalar(1, U16),
        x=x,
        y=y,
        heading=heading,
        lidar_ahead=ahead,
        lidar_field=field,
        lidar_reach=reach,
        lidar=lidar,
        radar_ahead=table.number(9, F32),
        radar_reach=table.number(10, F32),
        radar_angles=angles,
        radar=radar,
        radar_kinds=kinds,
    )
