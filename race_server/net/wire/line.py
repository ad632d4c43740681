"""Encode and decode the reference line for clients."""

from dataclasses import dataclass, field

import flatbuffers
import numpy as np
from numpy.typing import NDArray

from race_server.errors import WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.session import Line
from race_server.net.wire.strict import F64, root_of

# One sample per 5 cm over 25 km.
MOST_SAMPLES = 1 << 19
MOST_LINE = 1 << 24
MOST_NOTE = 1024

Floats = NDArray[np.float64]


def _none() -> Floats:
    return np.zeros(0)


@dataclass(frozen=True)
class LineSheet:
    """A closed line around a course, its N samples at equal steps; empty if there is none."""

    spacing: float = 0.0  # [m] between samples
    x: Floats = field(default_factory=_none)  # (N,) [m]
    y: Floats = field(default_factory=_none)  # (N,) [m]
    speed: Floats = field(default_factory=_none)  # (N,) [m/s]
    time: Floats = field(default_factory=_none)  # (N,) [s] since the first sample
    lap: float = 0.0  # [s]
    note: str = ""  # why it is not the line of the shortest lap


def encode_line(sheet: LineSheet) -> bytes:
    """Return a reference line as a message."""
    builder = flatbuffers.Builder(1024 + 32 * len(sheet.x))
    note = builder.CreateString(sheet.note[: MOST_NOTE // 4])
    x, y, speed, time = (
        builder.CreateNumpyVector(np.ascontiguousarray(values, "<f8"))
        for values in (sheet.x, sheet.y, sheet.speed, sheet.time)
    )
    Line.Start(builder)
    Line.AddSpacing(builder, sheet.spacing)
    Line.AddX(builder, x)
    Line.AddY(builder, y)
    Line.AddSpeed(builder, speed)
    Line.AddTime(builder, time)
    Line.AddLap(builder, sheet.lap)
    Line.AddNote(builder, note)
    builder.Finish(Line.End(builder), topics.LINE.identifier)
    return bytes(builder.Output())


def decode_line(data: bytes) -> LineSheet:
    """Return the reference line in a message.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, topics.LINE.identifier, MOST_LINE)
    vectors = []
    for slot in range(1, 5):
        first, count = table.vector(slot, F64.size, MOST_SAMPLES)
        vectors.append(np.frombuffer(data, "<f8", count, first))
    if len({len(values) for values in vectors}) > 1 or not np.isfinite(vectors).all():
        raise WireError("line has samples that are not finite, or not as many of each kind")
    x, y, speed, time = vectors
    return LineSheet(
        table.number(0, F64), x, y, speed, time, table.number(5, F64), table.text(6, MOST_NOTE)
    )
