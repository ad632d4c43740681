"""Encode and decode what a recording contains besides the public messages.

`schemas/journal.fbs` says what each message means. Recordings may come from any source, so they
are checked as strictly as messages of the network.
"""

from dataclasses import dataclass
from typing import Any

import flatbuffers
import numpy as np
from numpy.typing import NDArray

from race_server.errors import WireError
from race_server.net.wire.generated.journal import Act as ActStruct
from race_server.net.wire.generated.journal import (
    Acts,
    Digest,
    Granted,
    Inputs,
    Lap,
    RaceStart,
    Seat,
)
from race_server.net.wire.generated.journal import Input as InputStruct
from race_server.net.wire.rows import build_rows, build_vector
from race_server.net.wire.strict import I64, MOST_NAME, NAME_BYTES, U8, U16, U32, Table, root_of

START, INPUTS, ACTS, DIGEST, LAP = b"RSTA", b"RINP", b"RACT", b"RDIG", b"RLAP"
GRANTED = b"RGRA"

INPUT = np.dtype(
    [
        *((name, "<f4") for name in ("steering", "throttle", "brake")),
        ("buttons", "<u4"),
        ("sequence", "<u4"),
        ("seat", "<u2"),
        ("", "V2"),  # pads to a multiple of four
    ]
)
ACT = np.dtype([("value", "<f8"), ("tick", "<u4"), ("kind", "<u2"), ("kart", "<i2")])
MOST_SEATS, MOST_ACTS = 64, 4096
MOST_START, MOST_MESSAGE = 1 << 24, 1 << 17
MOST_KEY = 64

Rows = NDArray[Any]


@dataclass(frozen=True, slots=True)
class SeatRow:
    """The holder of a seat when the race starts."""

    number: int
    driver: str
    preset: str
    key: bytes  # digest of the secret
    is_local: bool
    is_tracked: bool = False  # a real kart


@dataclass(frozen=True, slots=True)
class StartFrame:
    """The race at its start."""

    session: str
    epoch: int
    pace: str
    decision_ticks: int
    started_at: str
    versions: str  # JSON
    setting: str  # JSON
    arrays: bytes  # .npz
    seats: tuple[SeatRow, ...]


def encode_start(frame: StartFrame) -> bytes:
    """Return the start of a race as a message."""
    builder = flatbuffers.Builder(len(frame.arrays) + 8192)
    rows = [_build_seat(builder, seat) for seat in frame.seats]
    seats = build_vector(builder, rows)
    arrays = builder.CreateByteVector(frame.arrays)
    names = ("Session", "Pace", "StartedAt", "Versions", "Setting")
    texts = (frame.session, frame.pace, frame.started_at, frame.versions, frame.setting)
    offsets = [builder.CreateString(text) for text in texts]
    RaceStart.Start(builder)
    for name, offset in zip(names, offsets, strict=True):
        getattr(RaceStart, f"Add{name}")(builder, offset)
    RaceStart.AddArrays(builder, arrays)
    RaceStart.AddSeats(builder, seats)
    RaceStart.AddEpoch(builder, frame.epoch)
    RaceStart.AddDecisionTicks(builder, frame.decision_ticks)
    builder.Finish(RaceStart.End(builder), START)
    return bytes(builder.Output())


def _build_seat(builder: Any, seat: SeatRow) -> int:
    driver, preset = builder.CreateString(seat.driver), builder.CreateString(seat.preset)
    key = builder.CreateByteVector(seat.key)
    Seat.Start(builder)
    Seat.AddDriver(builder, driver)
    Seat.AddPreset(builder, preset)
    Seat.AddKey(builder, key)
    Seat.AddNumber(builder, seat.number)
    Seat.AddIsLocal(builder, seat.is_local)
    Seat.AddIsTracked(builder, seat.is_tracked)
    return int(Seat.End(builder))


def decode_start(data: bytes) -> StartFrame:
    """Return the start of a race from a message.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, START, MOST_START)
    first, size = table.vector(5, 1, MOST_START)
    seats = tuple(_read_seat(row) for row in table.tables(6, MOST_SEATS))
    return StartFrame(
        session=table.text(0, 64),
        pace=table.text(1, 16),
        started_at=table.text(2, 64),
        versions=table.text(3, 4096),
        setting=table.text(4, 1 << 20),
        arrays=data[first : first + size],
        seats=seats,
        epoch=table.scalar(7, U32),
        decision_ticks=table.scalar(8, U32),
    )


def _read_seat(row: Table) -> SeatRow:
    first, count = row.vector(2, 1, MOST_KEY)
    return SeatRow(
        number=row.scalar(3, U16),
        driver=row.text(0, NAME_BYTES)[:MOST_NAME],
        preset=row.text(1, NAME_BYTES)[:MOST_NAME],
        key=row.data[first : first + count],
        is_local=row.scalar(4, U8) != 0,
        is_tracked=row.scalar(5, U8) != 0,
    )


def encode_inputs(tick: int, rows: Rows) -> bytes:
    """Return the controls (INPUT) that act from a tick on as a message."""
    builder = flatbuffers.Builder(64 + INPUT.itemsize * len(rows))
    Inputs.StartInputsVector(builder, len(rows))
    for row in rows[::-1]:
        InputStruct.CreateInput(builder, *row.item()[:6])
    inputs = builder.EndVector()
    Inputs.Start(builder)
    Inputs.AddTick(builder, tick)
    Inputs.AddInputs(builder, inputs)
    builder.Finish(Inputs.End(builder), INPUTS)
    return bytes(builder.Output())


def decode_inputs(data: bytes) -> tuple[int, Rows]:
    """Return tick and controls (INPUT) of a message.

    Raises:
        WireError: damaged, foreign, or a control out of range.
    """
    table = root_of(data, INPUTS, MOST_MESSAGE)
    first, count = table.vector(1, INPUT.itemsize, MOST_SEATS)
    rows = np.frombuffer(data, INPUT, count, first)
    for name in ("steering", "throttle", "brake"):
        if not (np.abs(rows[name]) <= 1.0).all():
            raise WireError(f"{name} outside [-1, 1]")
    return table.scalar(0, U32), rows


def encode_acts(rows: Rows) -> bytes:
    """Return interventions (ACT) as a message."""
    builder = flatbuffers.Builder(64 + ACT.itemsize * len(rows))
    acts = build_rows(builder, Acts.StartActsVector, ActStruct.CreateAct, rows)
    Acts.Start(builder)
    Acts.AddActs(builder, acts)
    builder.Finish(Acts.End(builder), ACTS)
    return bytes(builder.Output())


def decode_acts(data: bytes) -> Rows:
    """Return the interventions (ACT) of a message.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, ACTS, MOST_MESSAGE)
    first, count = table.vector(0, ACT.itemsize, MOST_ACTS)
    rows = np.frombuffer(data, ACT, count, first)
    if not np.isfinite(rows["value"]).all():
        raise WireError("the value of an intervention is not finite")
    return rows


def encode_granted(tick: int, key: bytes, serial: int) -> bytes:
    """Return a granted request before a tick as a message."""
    builder = flatbuffers.Builder(128)
    sender = builder.CreateByteVector(key)
    Granted.Start(builder)
    Granted.AddKey(builder, sender)
    Granted.AddSerial(builder, serial)
    Granted.AddTick(builder, tick)
    builder.Finish(Granted.End(builder), GRANTED)
    return bytes(builder.Output())


def decode_granted(data: bytes) -> tuple[int, bytes, int]:
    """Return tick, key and serial of a granted request.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, GRANTED, 256)
    first, count = table.vector(0, 1, MOST_KEY)
    return table.scalar(2, U32), data[first : first + count], table.scalar(1, U32)


def encode_digest(tick: int, digest: str, *, is_last: bool) -> bytes:
    """Return the digest of the world before a tick as a message."""
    builder = flatbuffers.Builder(128)
    text = builder.CreateString(digest)
    Digest.Start(builder)
    Digest.AddDigest(builder, text)
    Digest.AddTick(builder, tick)
    Digest.AddIsLast(builder, is_last)
    builder.Finish(Digest.End(builder), DIGEST)
    return bytes(builder.Output())


def decode_digest(data: bytes) -> tuple[int, str, bool]:
    """Return tick, digest and whether it is the last of a race.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, DIGEST, 256)
    place = table.field(2, 1)
    return table.scalar(1, U32), table.text(0, 64), bool(place and data[place])


def encode_lap(seat: int, number: int, time_us: int, tick: int) -> bytes:
    """Return a lap as a message."""
    builder = flatbuffers.Builder(64)
    Lap.Start(builder)
    Lap.AddTimeUs(builder, time_us)
    Lap.AddTick(builder, tick)
    Lap.AddNumber(builder, number)
    Lap.AddSeat(builder, seat)
    builder.Finish(Lap.End(builder), LAP)
    return bytes(builder.Output())


def decode_lap(data: bytes) -> tuple[int, int, int, int]:
    """Return seat, number, time [µs] and tick of a lap.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, LAP, 256)
    return (
        table.scalar(3, U16),
        table.scalar(2, U32),
        table.scalar(0, I64),
        table.scalar(1, U32),
    )
