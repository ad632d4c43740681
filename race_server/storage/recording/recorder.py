"""A thread that writes a race down while it is driven: the recording is its journal.

The loop of the server hands over what happened and never waits for the disk. Everything handed
over reaches the operating system within `FLUSH_S`, or at once where an announcement waits for it:
from then on it survives the death of this process. Only a power cut can take more.
"""

import contextlib
import queue
import threading
import time
from collections.abc import Callable
from functools import partial
from io import BufferedWriter
from pathlib import Path
from typing import Self

import numpy as np
from mcap.writer import CompressionType, Writer

from race_server import __version__
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
from race_server.session.tracked.karts import Placements
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

# What has been handed over is with the operating system after so long.
FLUSH_S = 0.05
CHUNK_BYTES = 64 * 1024
# Messages that wait for a disk that has stopped; a race goes on without its recording then.
MOST_WAITING = 1 << 16
CLOSE_S = 10.0

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

        begun_ns: when the race began, nanoseconds since 1970 in UTC; log: is told once if the
        recording fails.
        """
        self.path = Path(file.name)
        self._file = file
        self._begun_ns = begun_ns
        self._log = log
        self._writer = Writer(file, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start("race-server", f"race-server {__version__}")
        self._channels = {kind.key: self._register(kind, session) for kind in CHANNELS}
        self._queue: queue.SimpleQueue[Message | None] = queue.SimpleQueue()
        self._taken = 0
        self._settled = 0
        self._is_failing = False
        self._turn = threading.Condition()
        self._thread = threading.Thread(target=self._work, name="recording", daemon=True)
        self._thread.start()

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

    def write(self, kind: ChannelKind, tick: int, content: Content) -> int:
        """Hand a message over and return its ticket."""
        return self._hand_over((kind.key, self.time_of(tick), content))

    def time_of(self, tick: int) -> int:
        """Return the time of a tick [ns since 1970]."""
        return self._begun_ns + tick * NANOSECONDS // TICKS_PER_SECOND

    def copy(self, line: Line) -> int:
        """Hand a message of another recording over and return its ticket."""
        return self._hand_over((line.kind.key, line.time_ns, line.data))

    @property
    def backlog(self) -> int:
        """How many messages have been handed over and are not yet written."""
        return self._taken - self._settled

    def _hand_over(self, entry: Message) -> int:
        if not self._is_failing and self.backlog < MOST_WAITING:
            self._taken += 1
            self._queue.put(entry)
        return self._taken

    def begin(self, frame: StartFrame) -> None:
        """Write how the race begins."""
        self.write(START, 0, lambda: encode_start(frame))

    def note(self, log: list[Entry]) -> None:
        """Write what acted on the race since the last call, and empty the log."""
        for entry in log:
            if isinstance(entry, Inputs):
                self.write(INPUTS, entry.tick, partial(_encode_inputs, entry))
            elif isinstance(entry, Placements):
                self.write(PLACEMENTS, entry.tick, partial(_encode_placements, entry))
            elif isinstance(entry, Intervention):
                self.write(ACTS, entry.tick, partial(_encode_act, entry))
            else:
                numbers = (entry.tick, entry.key, entry.serial)
                self.write(GRANTED, entry.tick, partial(encode_granted, *numbers))
        log.clear()

    def note_digest(self, tick: int, digest: str, *, is_last: bool = False) -> int:
        """Write the digest of the world before a tick."""
        return self.write(DIGEST, tick, lambda: encode_digest(tick, digest, is_last=is_last))

    def note_lap(self, seat: int, number: int, time_us: int, tick: int) -> None:
        """Write a lap."""
        self.write(LAPS, tick, lambda: encode_lap(seat, number, time_us, tick))

    # When it is safe

    def hurry(self) -> int:
        """Have all that was handed over so far written at once, and return its ticket."""
        self._queue.put(_FLUSH)
        return self._taken

    def is_settled(self, ticket: int) -> bool:
        """Return whether all up to a ticket is with the operating system, or never will be."""
        return self._settled >= ticket or self._is_failing

    def wait(self, ticket: int, timeout_s: float) -> bool:
        """Wait until it is; False if it is not by the timeout."""
        with self._turn:
            return self._turn.wait_for(lambda: self.is_settled(ticket), timeout_s)

    def close(self) -> None:
        """Write what is left, then the index, and close the file."""
        self._queue.put(None)
        self._thread.join(CLOSE_S)

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
        """Write what comes within a flush's time, or until somebody waits; False after the last."""
        entry, count, goes_on = self._queue.get(), 0, True
        deadline = time.monotonic() + FLUSH_S
        while entry is not _FLUSH:
            if entry is None:
                goes_on = False
                break
            self._add(*entry)
            count += 1
            try:
                entry = self._queue.get(timeout=max(deadline - time.monotonic(), 0.0))
            except queue.Empty:
                break
        self._writer.flush()
        with self._turn:
            self._settled += count
            self._turn.notify_all()
        return goes_on

    def _add(self, key: str, at: int, content: Content) -> None:
        data = content if isinstance(content, bytes) else content()
        self._writer.add_message(self._channels[key], at, data, at)

    def _give_up(self, error: Exception) -> None:
        with self._turn:
            self._is_failing = True
            self._turn.notify_all()
        with contextlib.suppress(OSError, ValueError):
            self._file.close()
        reason = f"{type(error).__name__}: {error}"
        self._log(f"recording {self.path} takes no more ({reason}). The race goes on without it")


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
