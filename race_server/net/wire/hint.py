"""Encode and decode what a coach tells a driver."""

import math
import struct

import flatbuffers

from race_server.core.hint import Hint, HintKind
from race_server.errors import Reason, WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.drive import Hint as HintTable
from race_server.net.wire.generated.drive import Stretch
from race_server.net.wire.strict import F32, I64, U8, U32, U64, root_of

STRETCH = struct.Struct("<2f")
# Corners of a course, characters of the name of one and of a reason, metres, microseconds.
MOST_STRETCHES, MOST_CORNER, MOST_REASON = 64, 16, 80
MOST_METRES, MOST_US = 1e6, 1 << 53


def encode_hint(epoch: int, hint: Hint) -> bytes:
    """Return a hint for a driver of a race as a message."""
    builder = flatbuffers.Builder(256)
    corner = builder.CreateString(hint.corner[:MOST_CORNER])
    reason = builder.CreateString(hint.reason[:MOST_REASON])
    helped = hint.helped[:MOST_STRETCHES]
    HintTable.StartHelpedVector(builder, len(helped))
    for begin, end in reversed(helped):
        Stretch.CreateStretch(builder, begin, end)
    stretches = builder.EndVector()
    HintTable.Start(builder)
    HintTable.AddEpoch(builder, epoch)
    HintTable.AddLap(builder, hint.lap)
    HintTable.AddTime(builder, hint.time_us)
    HintTable.AddBehind(builder, hint.behind_us or 0)
    HintTable.AddIsCompared(builder, hint.behind_us is not None)
    HintTable.AddKind(builder, int(hint.kind))
    HintTable.AddSize(builder, hint.size)
    HintTable.AddReach(builder, hint.reach)
    HintTable.AddCorner(builder, corner)
    HintTable.AddReason(builder, reason)
    HintTable.AddHelped(builder, stretches)
    builder.Finish(HintTable.End(builder), topics.COACH.identifier)
    return bytes(builder.Output())


def decode_hint(data: bytes) -> tuple[int, Hint]:
    """Return the epoch of the race and the hint in a message.

    Raises:
        WireError: damaged, oversized, foreign, not finite or out of range; nothing else.
    """
    table = root_of(data, topics.COACH.identifier, topics.COACH.most_bytes)
    kind, time_us, behind_us = table.scalar(5, U8), table.scalar(2, U64), table.scalar(3, I64)
    size, reach = table.number(6, F32), table.number(7, F32)
    first, count = table.vector(10, STRETCH.size, MOST_STRETCHES)
    helped = tuple(
        STRETCH.iter_unpack(table.data[first : first + count * STRETCH.size])  # pairs
    )
    numbers = [size, reach, *(end for stretch in helped for end in stretch)]
    within = all(math.isfinite(each) and abs(each) <= MOST_METRES for each in numbers)
    if not within or kind > max(HintKind) or max(time_us, abs(behind_us)) > MOST_US:
        raise WireError(f"hint out of range: {kind}, {time_us} µs, {numbers}", Reason.OUT_OF_RANGE)
    return table.scalar(0, U32), Hint(
        lap=table.scalar(1, U32),
        time_us=time_us,
        behind_us=behind_us if table.scalar(4, U8) else None,
        reason=table.text(9, 4 * MOST_REASON),
        kind=HintKind(kind),
        corner=table.text(8, 4 * MOST_CORNER),
        size=size,
        reach=reach,
        helped=helped,
    )
