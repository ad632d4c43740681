"""Encode and decode snapshots and events; standings are in a file beside."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import flatbuffers
import numpy as np
from numpy.typing import NDArray

from race_server.core.messages import Event, EventKind, Flag, Phase
from race_server.errors import WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.spectate import Event as EventStruct
from race_server.net.wire.generated.spectate import (
    Events,
    Hazard,
    Kart,
    Snapshot,
    Trailer,
    Walker,
)
from race_server.net.wire.parking import (
    TRAILER,
    TRAILER_NAMES,
    WALKER,
    trailers_in,
    walkers_in,
)
from race_server.net.wire.rows import build_rows
from race_server.net.wire.standings import StandingsFrame as StandingsFrame
from race_server.net.wire.standings import decode_standings as decode_standings
from race_server.net.wire.standings import encode_standings as encode_standings
from race_server.net.wire.strict import F32, U8, U32, U64, Table, root_of

KART = np.dtype(
    [
        *((name, "<f4") for name in ("x", "y", "heading", "speed", "lateral_speed", "yaw_rate")),
        *((name, "<f4") for name in ("steering", "progress", "speed_cap")),
        *((name, "<u4") for name in ("acknowledged", "laps")),
        *((name, "<u2") for name in ("seat", "rank")),
        *((name, "u1") for name in ("status", "item", "effects", "flags")),
    ]
)
HAZARD = np.dtype(
    [("x", "<f4"), ("y", "<f4"), ("radius", "<f4"), ("item", "<u2"), ("owner", "<u2")]
)
EVENT = np.dtype(
    [
        ("value", "<i8"),
        ("sequence", "<u4"),
        ("tick", "<u4"),
        ("other", "<i4"),
        ("kart", "<i2"),
        ("kind", "<u2"),
    ]
)
MOST_KARTS, MOST_BOXES, MOST_HAZARDS, MOST_EVENTS = 64, 1024, 64, 1024
_KINDS = {int(kind) for kind in EventKind}

Rows = NDArray[Any]


@dataclass(frozen=True, slots=True)
class SnapshotFrame:
    """The race at one tick, as spectators see it."""

    monotonic_us: int
    epoch: int
    tick: int
    lights_s: float
    phase: Phase
    flag: Flag
    karts: Rows  # KART
    boxes: NDArray[np.uint8]
    hazards: Rows  # HAZARD
    walkers: Rows = field(default_factory=lambda: np.zeros(0, WALKER))  # WALKER
    trailers: Rows = field(default_factory=lambda: np.zeros(0, TRAILER))  # TRAILER


class SnapshotWriter:
    """Writes snapshots into preallocated messages, one for each count of what is in them."""

    def __init__(self) -> None:
        self._templates: dict[tuple[int, ...], _Template] = {}

    def write(self, frame: SnapshotFrame) -> bytes:
        """Return a snapshot as a message."""
        rows = (frame.karts, frame.boxes, frame.hazards, frame.walkers, frame.trailers)
        counts = tuple(map(len, rows))
        template = self._templates.get(counts)
        if template is None:
            template = self._templates[counts] = _Template(frame)
        return template.fill(frame)


class _Template:
    def __init__(self, frame: SnapshotFrame) -> None:
        self.data = bytearray(build_snapshot(frame))
        table = root_of(bytes(self.data), topics.SNAPSHOT.identifier, 1 << 20)
        self.places = [table.field(slot, 1) for slot in range(6)]
        karts, count = table.vector(6, KART.itemsize, MOST_KARTS)
        self.karts = np.frombuffer(self.data, KART, count, karts)
        boxes, count = table.vector(7, 1, MOST_BOXES)
        self.boxes = np.frombuffer(self.data, np.uint8, count, boxes)
        hazards, count = table.vector(8, HAZARD.itemsize, MOST_HAZARDS)
        self.hazards = np.frombuffer(self.data, HAZARD, count, hazards)
        self.walkers = walkers_in(table, self.data)
        self.trailers = trailers_in(table, self.data)

    def fill(self, frame: SnapshotFrame) -> bytes:
        data, places = self.data, self.places
        U64.pack_into(data, places[0], frame.monotonic_us)
        U32.pack_into(data, places[1], frame.epoch)
        U32.pack_into(data, places[2], frame.tick)
        F32.pack_into(data, places[3], frame.lights_s)
        data[places[4]] = int(frame.phase)
        data[places[5]] = int(frame.flag)
        self.karts[:] = frame.karts
        self.boxes[:] = frame.boxes
        self.hazards[:] = frame.hazards
        self.walkers[:] = frame.walkers
        self.trailers[:] = frame.trailers
        return bytes(data)


def build_snapshot(frame: SnapshotFrame) -> bytes:
    """Return a snapshot as the generated code encodes it: the reference for SnapshotWriter."""
    builder = flatbuffers.Builder(1024)
    builder.ForceDefaults(True)
    karts = build_rows(builder, Snapshot.StartKartsVector, Kart.CreateKart, frame.karts)
    boxes = builder.CreateByteVector(frame.boxes.tobytes())
    hazards = build_rows(builder, Snapshot.StartHazardsVector, Hazard.CreateHazard, frame.hazards)
    walkers = 0
    if len(frame.walkers):
        start = Snapshot.StartWalkersVector
        walkers = build_rows(builder, start, Walker.CreateWalker, frame.walkers)
    trailers = 0
    if len(frame.trailers):
        named = frame.trailers[TRAILER_NAMES]
        trailers = build_rows(builder, Snapshot.StartTrailersVector, Trailer.CreateTrailer, named)
    Snapshot.Start(builder)
    Snapshot.AddMonotonicUs(builder, frame.monotonic_us)
    Snapshot.AddEpoch(builder, frame.epoch)
    Snapshot.AddTick(builder, frame.tick)
    Snapshot.AddLights(builder, frame.lights_s)
    Snapshot.AddPhase(builder, int(frame.phase))
    Snapshot.AddFlag(builder, int(frame.flag))
    Snapshot.AddKarts(builder, karts)
    Snapshot.AddBoxes(builder, boxes)
    Snapshot.AddHazards(builder, hazards)
    if walkers:
        Snapshot.AddWalkers(builder, walkers)
    if trailers:
        Snapshot.AddTrailers(builder, trailers)
    builder.Finish(Snapshot.End(builder), topics.SNAPSHOT.identifier)
    return bytes(builder.Output())


def decode_snapshot(data: bytes) -> SnapshotFrame:
    """Return the snapshot in a message.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, topics.SNAPSHOT.identifier, topics.SNAPSHOT.most_bytes)
    first, count = table.vector(6, KART.itemsize, MOST_KARTS)
    karts = np.frombuffer(data, KART, count, first)
    first, count = table.vector(7, 1, MOST_BOXES)
    boxes = np.frombuffer(data, np.uint8, count, first)
    first, count = table.vector(8, HAZARD.itemsize, MOST_HAZARDS)
    hazards = np.frombuffer(data, HAZARD, count, first)
    numbers = np.frombuffer(data, np.uint8)  # keeps `data` alive for the views above
    if len(numbers) == 0 or not np.isfinite(karts["x"] + karts["y"] + karts["heading"]).all():
        raise WireError("snapshot holds a pose that is not finite")
    phase, flag = table.scalar(4, U8), table.scalar(5, U8)
    if phase > max(Phase) or flag > max(Flag):
        raise WireError(f"snapshot of phase {phase} and flag {flag}")
    return SnapshotFrame(
        monotonic_us=table.scalar(0, U64),
        epoch=table.scalar(1, U32),
        tick=table.scalar(2, U32),
        lights_s=table.number(3, F32),
        phase=Phase(phase),
        flag=Flag(flag),
        karts=karts,
        boxes=boxes,
        hazards=hazards,
        walkers=walkers_in(table, data),
        trailers=trailers_in(table, data),
    )


def encode_events(epoch: int, events: Sequence[Event]) -> bytes:
    """Return events as a message."""
    builder = flatbuffers.Builder(64 + EVENT.itemsize * len(events))
    Events.StartEventsVector(builder, len(events))
    for event in reversed(events):
        EventStruct.CreateEvent(
            builder,
            event.value,
            event.sequence,
            event.tick,
            event.other,
            event.kart,
            int(event.kind),
        )
    rows = builder.EndVector()
    details = bytes(event.detail for event in events)
    place = builder.CreateByteVector(details) if any(details) else 0
    Events.Start(builder)
    Events.AddEpoch(builder, epoch)
    Events.AddEvents(builder, rows)
    if place:
        Events.AddDetails(builder, place)
    builder.Finish(Events.End(builder), topics.EVENTS.identifier)
    return bytes(builder.Output())


def decode_events(data: bytes) -> tuple[int, list[Event]]:
    """Return epoch and events of a message; unknown kinds are skipped.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, topics.EVENTS.identifier, topics.EVENTS.most_bytes)
    first, count = table.vector(1, EVENT.itemsize, MOST_EVENTS)
    rows = np.frombuffer(data, EVENT, count, first).tolist()
    details = _details_of(table, count)
    return table.scalar(0, U32), [
        Event(sequence, tick, EventKind(kind), kart, other, value, detail)
        for (value, sequence, tick, other, kart, kind), detail in zip(rows, details, strict=True)
        if kind in _KINDS
    ]


def _details_of(table: Table, count: int) -> bytes:
    """Return the details of all events of a message; zeros where it holds none.

    Raises:
        WireError: they are not as many as the events.
    """
    if not table.field(2, 4):
        return bytes(count)
    first, found = table.vector(2, 1, MOST_EVENTS)
    if found != count:
        raise WireError(f"{found} details of {count} events")
    return table.data[first : first + count]
