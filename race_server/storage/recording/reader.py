"""Reading a recording, also one that was cut short: up to its last whole chunk."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

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
from race_server.storage.recording.chunks import ENDS, Channel, Record, places_in, records_at

NANOSECONDS = 1_000_000_000
_KNOWN = {kind.key: kind for kind in CHANNELS}


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
    kinds: dict[int, ChannelKind] = {}
    for record in _records(path):
        if record is None:
            yield None
        elif isinstance(record, Channel):
            learn(kinds, record)
        elif record.channel in kinds:
            yield Line(kinds[record.channel], record.time_ns, record.data)


def learn(kinds: dict[int, ChannelKind], channel: Channel) -> None:
    """Add a channel to those that are known by their number, if it is one of a race."""
    key = channel.topic.split("/", 2)[-1]
    if channel.topic.startswith("race/") and key in _KNOWN:
        kinds[channel.number] = _KNOWN[key]


def _records(path: Path) -> Iterator[Record | None]:
    """Yield records, those of a chunk only once it is known to be whole; None at a torn end."""
    count = 0
    try:
        with path.open("rb") as file:
            for place in places_in(file, path.stat().st_size):
                if place.opcode in ENDS:
                    return
                count += 1
                yield from records_at(file, place)
    except OSError as error:
        raise RecordingError(
            f"recording {path} cannot be read ({error.strerror or error})"
        ) from error
    except RecordingError as error:
        if count == 0:
            raise RecordingError(f"{path} is no recording: {error}") from error
    if count == 0:
        raise RecordingError(f"{path} is no recording: it ends after {path.stat().st_size} bytes")
    yield None


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
