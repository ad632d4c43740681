"""A recording by the tick: any moment of it, without reading all of it.

The file is a row of chunks, each of a second or less. Where they lie is found by stepping from one
to the next; what they hold is read when it is wanted. A file that was cut short ends with its last
whole chunk.
"""

from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache
from io import BufferedReader
from itertools import accumulate
from pathlib import Path
from typing import NamedTuple, Self

from mcap.opcode import Opcode

from race_server.core.clock import TICKS_PER_SECOND
from race_server.errors import RecordingError, WireError
from race_server.net.wire.journal import StartFrame, decode_digest, decode_start
from race_server.storage.recording.channels import (
    ALERTS,
    DIGEST,
    EVENTS,
    GHOSTS,
    LOTS,
    PROGRAMMES,
    SNAPSHOTS,
    STANDINGS,
    START,
    TELEMETRY,
    ChannelKind,
)
from race_server.storage.recording.chunks import (
    CHUNK,
    Channel,
    Message,
    Place,
    places_in,
    records_at,
)
from race_server.storage.recording.reader import NANOSECONDS, learn

# Chunks that are kept after they were read; each is 64 KiB and what was made of it.
KEPT_CHUNKS = 8
# Chunks to search backwards for the standings, which are written twice a second.
LOOK_BACK = 64
_SHOWN = {
    kind.key: kind
    for kind in (SNAPSHOTS, EVENTS, STANDINGS, LOTS, ALERTS, TELEMETRY, PROGRAMMES, GHOSTS)
}


@dataclass(frozen=True, slots=True)
class Moment:
    """One message of a recording."""

    kind: ChannelKind
    tick: int
    data: bytes


class _ChunkPlace(NamedTuple):
    """Where a chunk lies in the file, and which times it holds."""

    place: Place
    first_ns: int
    last_ns: int


class SeekableRecording:
    """A recorded race that is open at any tick. Not for two threads at once."""

    def __init__(self, path: Path) -> None:
        """Find out where what lies.

        Raises:
            RecordingError: no such file, no recording, or without the beginning of a race.
        """
        self.path = path
        try:
            self._file = path.open("rb")
        except OSError as error:
            raise RecordingError(
                f"recording {path.name} cannot be read ({error.strerror or error})"
            ) from error
        try:
            self._places = list(_chunk_places(self._file, path.stat().st_size))
            self._kinds: dict[int, ChannelKind] = {}
            self.start, self._begun_ns = self._beginning()
        except (WireError, RecordingError, OSError) as error:
            self._file.close()
            raise RecordingError(f"{path.name} is no recording of a race: {error}") from error
        # Messages of one tick may lie in any order, and so in either of two chunks.
        ends = (self._tick_of(place.last_ns) for place in self._places)
        self._ends = list(accumulate(ends, max))
        self._chunk = lru_cache(maxsize=KEPT_CHUNKS)(self._read)

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def last_tick(self) -> int:
        """The newest tick in it."""
        return self._ends[-1]

    def is_finished(self) -> bool:
        """Return whether the race came to its end."""
        for moment in reversed(self._all_of(len(self._places) - 1)):
            if moment.kind is DIGEST:
                return decode_digest(moment.data)[2]
        return False

    def between(self, after: int, last: int) -> list[Moment]:
        """Return what was shown after one tick, up to and with another, in order."""
        found: list[Moment] = []
        for number in range(self._first_with(after + 1), len(self._places)):
            if self._tick_of(self._places[number].first_ns) > last:
                break
            found += [m for m in self._chunk(number) if after < m.tick <= last]
        return found

    def newest(self, kind: ChannelKind, tick: int) -> Moment | None:
        """Return the newest message of a kind up to a tick, None where there is none."""
        begin = min(self._first_with(tick + 1), len(self._places) - 1)
        for number in range(begin, max(begin - LOOK_BACK, -1), -1):
            for moment in reversed(self._chunk(number)):
                if moment.kind is kind and moment.tick <= tick:
                    return moment
        return None

    def all_events(self) -> Iterator[Moment]:
        """Yield all messages of events; this reads the whole file, once."""
        for number in range(len(self._places)):
            yield from (moment for moment in self._read(number) if moment.kind is EVENTS)

    def _first_with(self, tick: int) -> int:
        """Return the first chunk that does not end before a tick."""
        return bisect_right(self._ends, tick - 1)

    def _tick_of(self, time_ns: int) -> int:
        return round((time_ns - self._begun_ns) * TICKS_PER_SECOND / NANOSECONDS)

    def _beginning(self) -> tuple[StartFrame, int]:
        for number in range(len(self._places)):
            for channel, time_ns, data in self._records(number):
                if self._kinds.get(channel) is START:
                    return decode_start(data), time_ns
        raise RecordingError("the beginning of a race is missing")

    def _read(self, number: int) -> list[Moment]:
        """Return what a chunk holds for who watches."""
        return [moment for moment in self._all_of(number) if moment.kind.key in _SHOWN]

    def _all_of(self, number: int) -> list[Moment]:
        return [
            Moment(self._kinds[channel], self._tick_of(time_ns), data)
            for channel, time_ns, data in self._records(number)
            if channel in self._kinds
        ]

    def _records(self, number: int) -> list[Message]:
        """Return the messages in a chunk; none of a damaged one."""
        try:
            records = records_at(self._file, self._places[number].place)
        except RecordingError:
            return []
        messages = []
        for record in records:
            if isinstance(record, Channel):
                learn(self._kinds, record)
            else:
                messages.append(record)
        return messages


def _chunk_places(file: BufferedReader, size: int) -> Iterator[_ChunkPlace]:
    """Yield the chunks of a file, up to its end or to where it is torn."""
    for place in places_in(file, size):
        if place.opcode == Opcode.CHUNK and place.length >= CHUNK.size:
            file.seek(place.offset)
            first_ns, last_ns, *_ = CHUNK.unpack(file.read(CHUNK.size))
            yield _ChunkPlace(place, first_ns, last_ns)
