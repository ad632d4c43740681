"""Reading a recording, also one that was cut short: up to its last whole chunk."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Channel, Chunk, DataEnd, Footer, Message
from mcap.stream_reader import StreamReader, breakup_chunk

from race_server.core.clock import TICKS_PER_SECOND
from race_server.errors import RecordingError, WireError
from race_server.net.wire.journal import (
    StartFrame,
    decode_acts,
    decode_digest,
    decode_granted,
    decode_inputs,
    decode_lap,
    decode_start,
)
from race_server.net.wire.placement import NUMBERS, decode_placements
from race_server.session.interventions import Intervention, InterventionKind
from race_server.session.journal_entries import Entry, Inputs
from race_server.session.replay_guard import Granted
from race_server.session.tracked.karts import Placements
from race_server.storage.recording.channels import (
    ACTS,
    CHANNELS,
    DIGEST,
    GRANTED,
    INPUTS,
    LAPS,
    PLACEMENTS,
    SNAPSHOTS,
    START,
    ChannelKind,
)

# A chunk of ours is far smaller; a damaged length must not fill the memory.
MOST_RECORD = 1 << 26
NANOSECONDS = 1_000_000_000


@dataclass(frozen=True, slots=True)
class Line:
    """One message of a recording as it lies in the file."""

    kind: ChannelKind
    time_ns: int
    data: bytes


@dataclass
class Recording:
    """All of a recording that is needed to drive it again."""

    path: Path
    start: StartFrame
    entries: list[Entry] = field(default_factory=list)
    digests: list[tuple[int, str]] = field(default_factory=list)
    laps: list[tuple[int, int, int, int]] = field(default_factory=list)  # seat, number, µs, tick
    is_complete: bool = False  # the race was over; without it the server died, or the file is cut
    is_torn: bool = False  # the file ends in the middle of something
    last_tick: int = 0  # the newest in the recording
    snapshot: bytes = b""  # the last one, as it was sent


def read_lines(path: Path) -> Iterator[Line | None]:
    """Yield all messages up to the last whole chunk, in order; None at a torn end.

    Raises:
        RecordingError: no such file, or it is no recording.
    """
    known = {kind.key: kind for kind in CHANNELS}
    kinds: dict[int, ChannelKind] = {}
    for record in _records(path):
        if record is None:
            yield None
        elif isinstance(record, Channel):
            key = record.topic.split("/", 2)[-1]
            if record.topic.startswith("race/") and key in known:
                kinds[record.id] = known[key]
        elif isinstance(record, Message) and record.channel_id in kinds:
            yield Line(kinds[record.channel_id], record.log_time, record.data)


def _records(path: Path) -> Iterator[Any]:
    try:
        with path.open("rb") as file:
            yield from _whole_records(StreamReader(file, emit_chunks=True, **_LIMITS), path)
    except OSError as error:
        raise RecordingError(
            f"recording {path} cannot be read ({error.strerror or error})"
        ) from error


_LIMITS: dict[str, Any] = {"record_size_limit": MOST_RECORD}


def _whole_records(reader: StreamReader, path: Path) -> Iterator[Any]:
    """Yield records, those of a chunk only once it is known to be whole; None at a torn end."""
    count = 0
    records = iter(reader.records)
    while True:
        try:
            record = next(records)
            inside = breakup_chunk(record, validate_crc=True) if isinstance(record, Chunk) else ()
        except StopIteration:
            return
        # Whatever a cut in the middle of a record, or a damaged one, makes the readers of records
        # and of compressed data trip over.
        except Exception as error:
            if count == 0:
                raise RecordingError(f"{path} is no recording: {error}") from error
            yield None
            return
        count += 1
        yield from inside
        if isinstance(record, (DataEnd, Footer)):
            return
        if not isinstance(record, Chunk):
            yield record


def read_recording(path: Path) -> Recording:
    """Return a recording; what comes after damage is left out.

    Raises:
        RecordingError: no such file, no recording, or without the beginning of a race.
    """
    recording: Recording | None = None
    begun_ns = 0
    for line in read_lines(path):
        if line is None:
            if recording:
                recording.is_torn = True
            break
        try:
            if line.kind is START:
                recording = Recording(path, decode_start(line.data))
                begun_ns = line.time_ns
            elif recording:
                _take(recording, line)
                tick = round((line.time_ns - begun_ns) * TICKS_PER_SECOND / NANOSECONDS)
                recording.last_tick = max(recording.last_tick, tick)
        except (WireError, ValueError) as error:
            raise RecordingError(
                f"recording {path} is damaged, or from a newer race-server: {error}"
            ) from error
    if recording is None:
        raise RecordingError(f"recording {path} does not hold the beginning of a race")
    return recording


def _take(recording: Recording, line: Line) -> None:
    if line.kind is INPUTS:
        tick, rows = decode_inputs(line.data)
        names = ("steering", "throttle", "brake", "buttons")
        controls = np.stack([rows[name] for name in names], axis=1).astype(np.float32)
        recording.entries.append(
            Inputs(tick, rows["seat"].astype("i8"), controls, rows["sequence"])
        )
    elif line.kind is ACTS:
        for value, tick, kind, kart in decode_acts(line.data).tolist():
            recording.entries.append(Intervention(tick, InterventionKind(kind), kart, value))
    elif line.kind is PLACEMENTS:
        tick, rows = decode_placements(line.data)
        columns = [rows[name].astype("f8") for name in ("seat", "trust", "fault", *NUMBERS)]
        orders = np.stack([rows["orders"], rows["acknowledged"]], axis=1).astype("i8")
        recording.entries.append(Placements(tick, np.stack(columns, axis=1), orders))
    elif line.kind is GRANTED:
        recording.entries.append(Granted(*decode_granted(line.data)))
    elif line.kind is SNAPSHOTS:
        recording.snapshot = line.data
    elif line.kind is DIGEST:
        tick, digest, is_last = decode_digest(line.data)
        recording.digests.append((tick, digest))
        recording.is_complete |= is_last
    elif line.kind is LAPS:
        recording.laps.append(decode_lap(line.data))
