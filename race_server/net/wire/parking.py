"""Encode and decode what concerns car parks: the order to park, and what was drawn for a round."""

import struct
from dataclasses import dataclass, fields
from typing import Any

import flatbuffers
import numpy as np
from numpy.typing import NDArray

from race_server.core.driver import MOST_POINTS
from race_server.core.level import Level
from race_server.core.messages import Ending, Parking, PlannedWay
from race_server.core.parking_order import ParkingOrder, Slot
from race_server.errors import WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.drive import ParkingOrder as OrderTable
from race_server.net.wire.generated.drive.Level import CreateLevel
from race_server.net.wire.generated.drive.Slot import CreateSlot
from race_server.net.wire.generated.spectate import Block, Goal, Lot
from race_server.net.wire.generated.spectate import PlannedWay as WayTable
from race_server.net.wire.generated.spectate.Parking import CreateParking
from race_server.net.wire.generated.spectate.Planned import CreatePlanned
from race_server.net.wire.rows import build_rows, build_vector
from race_server.net.wire.strict import F32, U8, U16, U32, Table, root_of

GOAL = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "heading", "length", "width")),
        ("slot", "<i2"),
        ("seat", "<u2"),
    ]
)
BLOCK = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "heading", "length", "width")),
        ("kind", "u1"),
        ("", "V3"),  # pads to a multiple of four
    ]
)
TRAILER = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "heading", "length", "width", "limit")),
        ("seat", "<u2"),
        ("", "V2"),  # pads to a multiple of four
    ]
)
TRAILER_NAMES = list(TRAILER.names or ())[:-1]
WALKER = np.dtype([("x", "<f4"), ("y", "<f4"), ("radius", "<f4")])
MOST_GOALS, MOST_WALKERS, MOST_TRAILERS, MOST_BLOCKS, MOST_NUMBERS = 64, 64, 192, 4096, 1 << 15
BLOCK_NAMES = list(BLOCK.names or ())[:-1]
_SLOT, _LEVEL = struct.Struct("<5f"), struct.Struct("<7fB3x")
_PARKING = struct.Struct("<ffIIhBx")
_PLANNED = struct.Struct("<ffI")
# Of a way with many changes of direction, which are all shown.
MOST_WAY_NUMBERS = 8 * MOST_POINTS
# The numbers of a level in the order of the message; `hold` is `hold_s`, and `fits` follows. What
# concerns trailers came later, and stands beside it.
_TOLERANCES = ("within", "along", "across", "turn", "still", "leave", "hold_s")
assert {*_TOLERANCES, "fits", "hitch", "last"} == {one.name for one in fields(Level)}

Rows = NDArray[Any]


@dataclass(frozen=True, slots=True, eq=False)
class OrderFrame:
    """An order to park, with its number among those to the seat in this epoch."""

    epoch: int
    sequence: int
    order: ParkingOrder


def encode_order(frame: OrderFrame) -> bytes:
    """Return an order to park as a message."""
    builder = flatbuffers.Builder(1024)
    builder.Finish(build_order(builder, frame), topics.ORDER.identifier)
    return bytes(builder.Output())


def build_order(builder: Any, frame: OrderFrame) -> int:
    """Write the table of an order and return its offset."""
    order = frame.order
    walls = builder.CreateNumpyVector(np.ascontiguousarray(order.walls, "<f4").ravel())
    blocks = builder.CreateNumpyVector(np.ascontiguousarray(order.blocks, "<f4").ravel())
    OrderTable.Start(builder)
    OrderTable.AddEpoch(builder, frame.epoch)
    OrderTable.AddSequence(builder, frame.sequence)
    OrderTable.AddSlot(builder, CreateSlot(builder, *order.slot))
    tolerances = [getattr(order.level, name) for name in (*_TOLERANCES, "fits")]
    OrderTable.AddLevel(builder, CreateLevel(builder, *tolerances))
    OrderTable.AddWalls(builder, walls)
    OrderTable.AddBlocks(builder, blocks)
    OrderTable.AddHitch(builder, order.level.hitch)
    OrderTable.AddLast(builder, order.level.last)
    return int(OrderTable.End(builder))


def decode_order(data: bytes) -> OrderFrame:
    """Return the order to park in a message.

    Raises:
        WireError: damaged, foreign, or a number that is not finite.
    """
    return read_order(root_of(data, topics.ORDER.identifier, topics.ORDER.most_bytes))


def read_order(table: Table) -> OrderFrame:
    """Return the order to park in a table.

    Raises:
        WireError: damaged, or a number that is not finite.
    """
    slot, level = table.field(2, _SLOT.size), table.field(3, _LEVEL.size)
    if not (slot and level):
        raise WireError("an order to park without a slot")
    place = _SLOT.unpack_from(table.data, slot)
    *tolerances, fits = _LEVEL.unpack_from(table.data, level)
    walls, blocks = _numbers(table, 4, 4), _numbers(table, 5, 5)
    named = dict(zip(_TOLERANCES, tolerances, strict=True))
    named["hitch"] = table.number(6, F32)
    if not np.isfinite([*place, *named.values()]).all():
        raise WireError("an order to park holds a number that is not finite")
    choices = {"fits": bool(fits), "last": bool(table.scalar(7, U8))}
    order = ParkingOrder(Slot(*place), Level(**named, **choices), walls, blocks)
    return OrderFrame(table.scalar(0, U32), table.scalar(1, U32), order)


def _numbers(
    table: Table, slot: int, columns: int, most: int = MOST_NUMBERS
) -> NDArray[np.float64]:
    """Return a vector of at most `most` float32 as rows of `columns`.

    Raises:
        WireError: it is missing, longer, leaves the message, holds a number that is not finite, or
            its last row is not whole.
    """
    first, count = table.vector(slot, 4, most)
    if count % columns:
        raise WireError(f"field {slot} of {count} numbers; rows have {columns}")
    numbers = np.frombuffer(table.data, "<f4", count, first)
    if not np.isfinite(numbers).all():
        raise WireError(f"field {slot} holds a number that is not finite")
    return numbers.astype(float).reshape(-1, columns)


@dataclass(frozen=True, slots=True)
class LotFrame:
    """What was drawn for a round in a car park."""

    epoch: int
    tick: int
    goals: Rows  # GOAL
    blocks: Rows  # BLOCK
    ways: tuple["WayFrame", ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class WayFrame:
    """The way that a parking driver of the server has planned."""

    seat: int
    points: NDArray[np.float64]  # (N, 2) x, y [m] of the middle of the body


def encode_lot(frame: LotFrame) -> bytes:
    """Return a round in a car park as a message."""
    builder = flatbuffers.Builder(1024)
    goals = build_rows(builder, Lot.StartGoalsVector, Goal.CreateGoal, frame.goals)
    named = frame.blocks[BLOCK_NAMES]
    blocks = build_rows(builder, Lot.StartBlocksVector, Block.CreateBlock, named)
    ways = _build_ways(builder, frame.ways) if frame.ways else 0
    Lot.Start(builder)
    Lot.AddEpoch(builder, frame.epoch)
    Lot.AddTick(builder, frame.tick)
    Lot.AddGoals(builder, goals)
    Lot.AddBlocks(builder, blocks)
    if ways:
        Lot.AddWays(builder, ways)
    builder.Finish(Lot.End(builder), topics.LOT.identifier)
    return bytes(builder.Output())


def _build_ways(builder: Any, ways: tuple[WayFrame, ...]) -> int:
    """Write planned ways and return the offset of their vector."""
    offsets = []
    for way in ways:
        points = builder.CreateNumpyVector(np.ascontiguousarray(way.points, "<f4").ravel())
        WayTable.Start(builder)
        WayTable.AddSeat(builder, way.seat)
        WayTable.AddPoints(builder, points)
        offsets.append(WayTable.End(builder))
    return build_vector(builder, offsets)


def decode_lot(data: bytes) -> LotFrame:
    """Return a round in a car park from a message.

    Raises:
        WireError: damaged, foreign, or a place that is not finite.
    """
    table = root_of(data, topics.LOT.identifier, topics.LOT.most_bytes)
    first, count = table.vector(2, GOAL.itemsize, MOST_GOALS)
    goals = np.frombuffer(data, GOAL, count, first)
    first, count = table.vector(3, BLOCK.itemsize, MOST_BLOCKS)
    blocks = np.frombuffer(data, BLOCK, count, first)
    for rows in (goals, blocks):
        if not all(np.isfinite(rows[name]).all() for name in BLOCK_NAMES[:-1]):
            raise WireError("a car park holds a place that is not finite")
    return LotFrame(table.scalar(0, U32), table.scalar(1, U32), goals, blocks, _ways_in(table))


def _ways_in(table: Table) -> tuple[WayFrame, ...]:
    """Return the planned ways of a car park; none in a message from before there were any."""
    if not table.field(4, U32.size):
        return ()
    return tuple(
        WayFrame(one.scalar(0, U16), _numbers(one, 1, 2, MOST_WAY_NUMBERS))
        for one in table.tables(4, MOST_GOALS)
    )


def walkers_in(table: Table, data: bytes | bytearray) -> Rows:
    """Return the people (WALKER) in a snapshot; none in one from before there were any."""
    if not table.field(9, U32.size):
        return np.zeros(0, WALKER)
    first, count = table.vector(9, WALKER.itemsize, MOST_WALKERS)
    return np.frombuffer(data, WALKER, count, first)


def trailers_in(table: Table, data: bytes | bytearray) -> Rows:
    """Return the trailers (TRAILER) in a snapshot; none in one from before there were any."""
    if not table.field(10, U32.size):
        return np.zeros(0, TRAILER)
    first, count = table.vector(10, TRAILER.itemsize, MOST_TRAILERS)
    return np.frombuffer(data, TRAILER, count, first)


def add_parking(builder: Any, parking: Parking) -> int:
    """Write the figures of a vehicle that parks and return their offset."""
    figures = (parking.way, parking.reversed, parking.moves, parking.walked_into)
    return int(CreateParking(builder, *figures, parking.slot, int(parking.ending)))


def read_parking(table: Table, slot: int) -> Parking | None:
    """Return the figures of a vehicle that parks; None where there are none.

    Raises:
        WireError: an ending that is not known, or a way that is not finite.
    """
    place = table.field(slot, _PARKING.size)
    if not place:
        return None
    way, back, moves, walked_into, number, ending = _PARKING.unpack_from(table.data, place)
    if ending > max(Ending) or not np.isfinite((way, back)).all():
        raise WireError(f"standings are damaged: a way of {way} m with ending {ending}")
    return Parking(Ending(ending), number, way, back, moves, walked_into)


def add_planned(builder: Any, planned: PlannedWay) -> int:
    """Write the figures of a plan and return their offset."""
    figures = (planned.time_s, planned.path_m, planned.direction_changes)
    return int(CreatePlanned(builder, *figures))


def read_planned(table: Table, slot: int) -> PlannedWay | None:
    """Return the figures of a plan; None where there are none.

    Raises:
        WireError: a figure that is not finite.
    """
    place = table.field(slot, _PLANNED.size)
    if not place:
        return None
    time_s, path_m, changes = _PLANNED.unpack_from(table.data, place)
    if not np.isfinite((time_s, path_m)).all():
        raise WireError(f"standings are damaged: a plan of {path_m} m in {time_s} s")
    return PlannedWay(time_s, path_m, changes)
