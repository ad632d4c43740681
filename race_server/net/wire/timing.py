"""Encode and decode what live timing shows of a kart: a part of its row in the standings."""

import struct
from typing import Any

import numpy as np

from race_server.core.messages import Merit, Timing
from race_server.core.stint import MOST_STINTS, Stint
from race_server.errors import WireError
from race_server.net.wire.generated.spectate import Stint as StintStruct
from race_server.net.wire.generated.spectate import Timing as TimingTable
from race_server.net.wire.strict import I16, I64, U32, Table

MOST_SECTIONS = 64
_STINT = struct.Struct("<qIII4x")


def add_timing(builder: Any, timing: Timing) -> int:
    """Write the timing of a kart and return its offset."""
    sectors = builder.CreateNumpyVector(np.array(timing.sectors_us, np.int64))
    sector_merits = builder.CreateByteVector(bytes(timing.sector_merits))
    mini_merits = builder.CreateByteVector(bytes(timing.mini_merits))
    TimingTable.StartStintsVector(builder, len(timing.stints))
    for one in reversed(timing.stints):
        StintStruct.CreateStint(builder, one.best_us, one.first_lap, one.laps, one.items)
    stints = builder.EndVector()
    TimingTable.Start(builder)
    TimingTable.AddIntervalUs(builder, timing.interval_us)
    TimingTable.AddTheoreticalUs(builder, timing.theoretical_us)
    TimingTable.AddLapsDown(builder, timing.laps_down)
    TimingTable.AddGained(builder, timing.gained)
    TimingTable.AddSectorsUs(builder, sectors)
    TimingTable.AddSectorMerits(builder, sector_merits)
    TimingTable.AddMiniMerits(builder, mini_merits)
    TimingTable.AddStints(builder, stints)
    return int(TimingTable.End(builder))


def read_timing(row: Table, slot: int) -> Timing | None:
    """Return the timing in a row of the standings; None where there is none.

    Raises:
        WireError: damaged, or a merit that is not known.
    """
    table = row.table(slot)
    if table is None:
        return None
    first, count = table.vector(4, I64.size, MOST_SECTIONS)
    return Timing(
        interval_us=table.scalar(0, I64),
        theoretical_us=table.scalar(1, I64),
        laps_down=table.scalar(2, U32),
        gained=table.scalar(3, I16),
        sectors_us=struct.unpack_from(f"<{count}q", table.data, first),
        sector_merits=_merits(table, 5),
        mini_merits=_merits(table, 6),
        stints=_stints(table),
    )


def _stints(table: Table) -> tuple[Stint, ...]:
    if not table.field(7, 4):
        return ()  # of an older recording
    first, count = table.vector(7, _STINT.size, MOST_STINTS)
    rows = _STINT.iter_unpack(table.data[first : first + count * _STINT.size])
    return tuple(Stint(first_lap, laps, best_us, items) for best_us, first_lap, laps, items in rows)


def _merits(table: Table, slot: int) -> tuple[Merit, ...]:
    first, count = table.vector(slot, 1, MOST_SECTIONS)
    codes = table.data[first : first + count]
    if any(code > max(Merit) for code in codes):
        raise WireError(f"standings are damaged: merits {list(codes)}; at most {int(max(Merit))}")
    return tuple(Merit(code) for code in codes)
