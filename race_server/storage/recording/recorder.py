"""A thread that writes a race down while it is driven: the recording is its journal.

The loop of the server hands over what happened and never waits for the disk. Everything handed
over reaches the operating system within `FLUSH_S`, or at once where an announcement waits for it:
from then on it survives the death of this process. Only a power cut can take more.
"""

import contextlib
import queue
import time
from collections.abc import Callable, Iterable
from functools import partial
from io import BufferedWriter
from pathlib import Path
from typing import Self

import numpy as np
from mcap.writer import CompressionType, Writer

from race_server.core.clock import TICKS_PER_SECOND
from race_server.net.wire.journal import (
    ACT,
    INPUT,
    StartFrame,
    encode_acts,
    encode_digest,
    encode_granted,
    encode_inputs,
    encode_lap,
    encode_start,
)
from race_server.net.wire.placement import NUMBERS, PLACED, encode_placements
from race_server.session.interventions import Intervention
from race_server.session.journal_entries import Entry, Inputs
from race_server.session.lap_log import Lap
from race_server.session.tracked.karts import Placements
from race_server.storage.queue import Ticket, TicketQueue
from race_server.storage.recording.channels import (
    ACTS,
    CHANNELS,
    DIGEST,
    GRANTED,
    INPUTS,
    LAPS,
    PLACEMENTS,
    START,
    ChannelKind,
)
from race_server.storage.recording.reader import NANOSECONDS, Line
from race_server.version import __version__

# What has been handed over is with the operating system after this time.
FLUSH_S = 0.05
CHUNK_BYTES = 64 * 1024
# Messages that wait for a disk that has stopped; a race goes on without its recording then.
MOST_WAITING = 1 << 16
# Messages of another recording that may wait for the disk, and for how long.
COPIED_AT_ONCE, COPY_S = 4096, 60.0

# A message, or what makes one: encoding is left to the thread.
Content = bytes | Callable[[], bytes]
# A channel's key, the time [ns], and the message; a flush is wanted where there is no channel.
Message = tuple[str, int, Content]
_FLUSH: Message = ("", 0, b"")


class Recorder:
    """One recording that is being written. Times in it are ticks from its beginning."""

    def __init__(
        self, file: BufferedWriter, session: str, begun_ns: int, log: Callable[[str], None]
    ) -> None:
        """Begin the file and start the thread.

        begun_ns: when the race began, nanoseconds since 1970 in UTC; log: called once if the
        recording fails.
        """
        self.path = Path(file.name)
        self._file = file
        self._begun_ns = begun_ns
        self._log = log
        self.fault = ""  # why it takes no more
        self._writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start("race-server", f"race-server {__version__}")
        self._channels = {kind.key: self._register(kind, session) for kind in CHANNELS}
        self._queue: TicketQueue[Message] = TicketQueue("recording", self._work)
        self._queue.start()

    def _register(self, kind: ChannelKind, session: str) -> int:
        schema = self._writer.register_schema(
            kind.schema_name, kind.schema_encoding, kind.schema_data
        )
        return self._writer.register_channel(f"race/{session}/{kind.key}", kind.encoding, schema)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    # What the server hands over; none of these waits

    def write(self, kind: ChannelKind, tick: int, content: Content) -> None:
        """Hand a message over."""
        self._hand_over((kind.key, self.time_of(tick), content))

    def time_of(self, tick: int) -> int:
        """Return the time of a tick [ns since 1970]."""
        return self._begun_ns + tick * NANOSECONDS // TICKS_PER_SECOND

    def copy(self, line: Line) -> None:
        """Hand a message of another recording over."""
        self._hand_over((line.kind.key, line.time_ns, line.data))

    def copy_all(self, lines: Iterable[Line]) -> bool:
        """Copy messages no faster than the disk takes them; this waits.

        Return whether all of them are with the operating system.
        """
        for number, line in enumerate(lines, 1):
            self.copy(line)
            if number % COPIED_AT_ONCE == 0 and not self._has_written():
                return False
        return self._has_written()

    def _has_written(self) -> bool:
        return self.flush().wait(COPY_S) and not self.is_failing

    @property
    def backlog(self) -> int:
        """How many messages have been handed over and are not yet written."""
        return self._queue.backlog

    @property
    def is_failing(self) -> bool:
        """Whether the recording takes no more."""
        return bool(self.fault)

    def _hand_over(self, entry: Message) -> None:
        if self.is_failing:
            return
        if self.backlog < MOST_WAITING:
            self._queue.put(entry)
        else:
            # With a gap in it, it would be another race: it ends before the gap.
            self._fail(f"{self.backlog} messages wait for the disk")

    def _fail(self, fault: str) -> None:
        """Take no more from now on, and say why, once."""
        if not self.is_failing:
            self.fault = fault
            self._log(f"recording {self.path} takes no more ({fault}). The race goes on without it")

    def begin(self, frame: StartFrame) -> None:
        """Write how the race begins."""
        self.write(START, 0, lambda: encode_start(frame))

    def record(self, entries: Iterable[Entry]) -> None:
        """Write what acted on the race."""
        for entry in entries:
            if isinstance(entry, Inputs):
                self.write(INPUTS, entry.tick, partial(_encode_inputs, entry))
            elif isinstance(entry, Placements):
                self.write(PLACEMENTS, entry.tick, partial(_encode_placements, entry))
            elif isinstance(entry, Intervention):
                self.write(ACTS, entry.tick, partial(_encode_act, entry))
            else:
                numbers = (entry.tick, entry.key, entry.serial)
                self.write(GRANTED, entry.tick, partial(encode_granted, *numbers))

    def record_digest(self, tick: int, digest: str, *, is_last: bool = False) -> None:
        """Write the digest of the world before a tick."""
        self.write(DIGEST, tick, lambda: encode_digest(tick, digest, is_last=is_last))

    def record_lap(self, lap: Lap) -> None:
        """Write a lap."""
        numbers = (lap.seat, lap.number, lap.time_us, lap.tick)
        self.write(LAPS, lap.tick, partial(encode_lap, *numbers))

    # When it is safe

    def flush(self) -> Ticket:
        """Have all that was handed over so far written at once, and return its ticket.

        It is settled once all of it is with the operating system, or never will be.
        """
        self._queue.wake(_FLUSH)
        return self._queue.newest

    def close(self) -> None:
        """Write what is left, then the index, and close the file."""
        self._queue.close()

    # The thread

    def _work(self) -> None:
        try:
            while self._write_batch():
                pass
            self._writer.finish()
            self._file.close()
        except Exception as error:
            self._give_up(error)

    def _write_batch(self) -> bool:
        """Write what comes within a flush's time, or until a flush; False after the last."""
        entry, count, goes_on = self._queue.get(), 0, True
        deadline = time.monotonic() + FLUSH_S
        while entry is not _FLUSH:
            if entry is None:
                goes_on = False
                break
            self._add(*entry)
            count += 1
            try:
                entry = self._queue.get(max(deadline - time.monotonic(), 0.0))
            except queue.Empty:
                break
        self._writer.flush()
        self._queue.settle(count)
        return goes_on

    def _add(self, key: str, at: int, content: Content) -> None:
        data = content if isinstance(content, bytes) else content()
        self._writer.add_message(self._channels[key], at, data, at)

    def _give_up(self, error: Exception) -> None:
        self._fail(f"{type(error).__name__}: {error}")
        self._queue.settle(0, is_failing=True)
        with contextlib.suppress(OSError, ValueError):
            self._file.close()


def _encode_inputs(inputs: Inputs) -> bytes:
    rows = np.zeros(len(inputs.seats), INPUT)
    for column, name in enumerate(("steering", "throttle", "brake", "buttons")):
        rows[name] = inputs.controls[:, column]
    rows["sequence"], rows["seat"] = inputs.sequences, inputs.seats
    return encode_inputs(inputs.tick, rows)


def _encode_placements(placements: Placements) -> bytes:
    rows = np.zeros(len(placements.rows), PLACED)
    for column, name in enumerate(("seat", "trust", "fault", *NUMBERS)):
        rows[name] = placements.rows[:, column]
    rows["orders"], rows["acknowledged"] = placements.orders.T
    return encode_placements(placements.tick, rows)


def _encode_act(act: Intervention) -> bytes:
    row = np.zeros(1, ACT)
    row["value"], row["tick"], row["kind"], row["kart"] = act.value, act.tick, act.kind, act.kart
    return encode_acts(row)
