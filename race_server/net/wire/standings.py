"""Encode and decode standings."""

import struct
from dataclasses import dataclass
from typing import Any

import flatbuffers

from race_server.core.messages import Flag, Phase, Standing, Status
from race_server.errors import WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.spectate import Standing as StandingTable
from race_server.net.wire.generated.spectate import Standings
from race_server.net.wire.parking import add_parking, add_planned, read_parking, read_planned
from race_server.net.wire.rows import build_vector
from race_server.net.wire.strict import I64, MOST_NAME, NAME_BYTES, U8, U16, U32, Table, root_of
from race_server.net.wire.timing import add_timing, read_timing

MOST_ROWS = 64
# Bytes of the name of a course: that of a file, at most 255, and what may be added to it.
COURSE_BYTES = 320


@dataclass(frozen=True, slots=True)
class StandingsFrame:
    """The standings with the state of the race."""

    epoch: int
    tick: int
    start_tick: int
    phase: Phase
    flag: Flag
    laps: int
    course: str
    rows: tuple[Standing, ...]

    def as_json(self) -> dict[str, Any]:
        """Return plain data; what has a name by its name."""
        named = {"phase": self.phase.name.lower(), "flag": self.flag.name.lower()}
        rows = [row.as_json() for row in self.rows]
        numbers = {name: getattr(self, name) for name in ("epoch", "tick", "start_tick", "laps")}
        return {"course": self.course, **numbers, **named, "rows": rows}


# Slot and layout of each number of a row.
_NUMBERS = {
    "seat": (1, U16),
    "rank": (2, U16),
    "laps": (3, U32),
    "status": (4, U8),
    "last_lap_us": (5, I64),
    "best_lap_us": (6, I64),
    "race_time_us": (7, I64),
    "gap_us": (8, I64),
    "penalties": (9, U32),
    "penalty_us": (10, I64),
    "items_used": (11, U32),
}


def _camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.split("_"))


def encode_standings(frame: StandingsFrame) -> bytes:
    """Return standings as a message."""
    builder = flatbuffers.Builder(1024)
    offsets = []
    for row in frame.rows:
        driver = builder.CreateString(row.driver)
        StandingTable.StartLapTimesUsVector(builder, len(row.lap_times_us))
        for lap_us in reversed(row.lap_times_us):
            builder.PrependInt64(lap_us)
        laps = builder.EndVector()
        timing = add_timing(builder, row.timing) if row.timing else 0
        StandingTable.Start(builder)
        StandingTable.AddDriver(builder, driver)
        for name in _NUMBERS:
            getattr(StandingTable, f"Add{_camel(name)}")(builder, int(getattr(row, name)))
        StandingTable.AddLapTimesUs(builder, laps)
        if row.parking is not None:
            StandingTable.AddParking(builder, add_parking(builder, row.parking))
        if row.planned is not None:
            StandingTable.AddPlanned(builder, add_planned(builder, row.planned))
        if timing:
            StandingTable.AddTiming(builder, timing)
        offsets.append(StandingTable.End(builder))
    rows = build_vector(builder, offsets)
    course = builder.CreateString(frame.course)
    Standings.Start(builder)
    Standings.AddEpoch(builder, frame.epoch)
    Standings.AddTick(builder, frame.tick)
    Standings.AddStartTick(builder, frame.start_tick)
    Standings.AddPhase(builder, int(frame.phase))
    Standings.AddFlag(builder, int(frame.flag))
    Standings.AddLaps(builder, frame.laps)
    Standings.AddCourse(builder, course)
    Standings.AddRows(builder, rows)
    builder.Finish(Standings.End(builder), topics.STANDINGS.identifier)
    return bytes(builder.Output())


def decode_standings(data: bytes) -> StandingsFrame:
    """Return the standings in a message.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, topics.STANDINGS.identifier, topics.STANDINGS.most_bytes)
    # Rows may point at the same laps again and again: together they are no longer than the message.
    left = len(data) // I64.size
    rows = []
    for row in table.tables(7, MOST_ROWS):
        rows.append(_standing(row, left))
        left -= len(rows[-1].lap_times_us)
    try:
        phase, flag = Phase(table.scalar(3, U8)), Flag(table.scalar(4, U8))
    except ValueError as error:
        raise WireError(f"standings are damaged: {error}") from error
    return StandingsFrame(
        epoch=table.scalar(0, U32),
        tick=table.scalar(1, U32),
        start_tick=table.scalar(2, U32),
        phase=phase,
        flag=flag,
        laps=table.scalar(5, U32),
        course=table.text(6, COURSE_BYTES),
        rows=tuple(rows),
    )


def _standing(row: Table, most_laps: int) -> Standing:
    numbers = {name: row.scalar(slot, layout) for name, (slot, layout) in _NUMBERS.items()}
    laps: tuple[int, ...] = ()
    if row.field(12, U32.size):
        first, count = row.vector(12, I64.size, most_laps)
        laps = struct.unpack_from(f"<{count}q", row.data, first)
    try:
        status = Status(numbers.pop("status"))
    except ValueError as error:
        raise WireError(f"standings are damaged: {error}") from error
    driver = row.text(0, NAME_BYTES)[:MOST_NAME]
    parking, planned = read_parking(row, 13), read_planned(row, 14)
    timing = read_timing(row, 15)
    return Standing(
        **numbers,
        status=status,
        driver=driver,
        lap_times_us=laps,
        parking=parking,
        planned=planned,
        timing=timing,
    )
