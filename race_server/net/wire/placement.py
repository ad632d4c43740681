"""Encode and decode the placements of real karts in a recording."""

from typing import Any

import flatbuffers
import numpy as np
from numpy.typing import NDArray

from race_server.core.messages import PoseFault, Trust
from race_server.errors import WireError
from race_server.net.wire.generated.journal import Placement as PlacementStruct
from race_server.net.wire.generated.journal import Placements
from race_server.net.wire.rows import build_rows
from race_server.net.wire.strict import U32, root_of

PLACEMENTS = b"RPLA"
NUMBERS = ("x", "y", "heading", "speed", "lateral_speed", "yaw_rate", "steering")
PLACED = np.dtype(
    [
        *((name, "<f4") for name in NUMBERS),
        *((name, "<u4") for name in ("orders", "acknowledged")),
        ("seat", "<u2"),
        *((name, "u1") for name in ("trust", "fault")),
    ]
)
MOST_SEATS = 64
MOST_BYTES = 1 << 13

Rows = NDArray[Any]


def encode_placements(tick: int, rows: Rows) -> bytes:
    """Return the placements (PLACED) of real karts before a tick as a message."""
    builder = flatbuffers.Builder(64 + PLACED.itemsize * len(rows))
    placements = build_rows(
        builder, Placements.StartPlacementsVector, PlacementStruct.CreatePlacement, rows
    )
    Placements.Start(builder)
    Placements.AddTick(builder, tick)
    Placements.AddPlacements(builder, placements)
    builder.Finish(Placements.End(builder), PLACEMENTS)
    return bytes(builder.Output())


def decode_placements(data: bytes) -> tuple[int, Rows]:
    """Return tick and placements (PLACED) of a message.

    Raises:
        WireError: damaged, foreign, or a placement out of range.
    """
    table = root_of(data, PLACEMENTS, MOST_BYTES)
    first, count = table.vector(1, PLACED.itemsize, MOST_SEATS)
    rows = np.frombuffer(data, PLACED, count, first)
    for name in NUMBERS:
        if not np.isfinite(rows[name]).all():
            raise WireError(f"{name} of a real kart is not finite")
    if (rows["trust"] > max(Trust)).any() or (rows["fault"] > max(PoseFault)).any():
        raise WireError("a real kart's trust or pose fault is unknown")
    return table.scalar(0, U32), rows
