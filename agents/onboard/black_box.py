"""The black box of a kart: what it sensed, knew, decided and did, at every turn, as MCAP.

The safety side hands each turn over and never waits for the disk: a thread writes. What was handed
over reaches the operating system at least twice a second, so a program that is killed takes half a
second with it, and a kart that loses its power what the system had not written yet. A disk that
takes no more is tried again. Messages are JSON, so that any reader of MCAP shows them.
"""

import contextlib
import json
import math
import queue
import struct
import threading
import time
from collections.abc import Iterator
from io import BufferedReader
from pathlib import Path
from typing import IO, Any, Self, cast

from mcap.exceptions import McapError
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, Writer
from zstandard import ZstdError

from race_agents.onboard.incident_ring import IncidentRing, Noted, is_incident
from race_agents.onboard.kept_output import KeptOutput
from race_agents.onboard.turns import Turn, fault_in
from race_agents.unit.control_unit import ControlUnit
from race_agents.unit.readings import Readings
from race_server.errors import RecordingError
from race_server.storage.queue import TicketQueue
from race_server.terminal import say
from race_server.version import __version__

FLUSH_S = 0.5
# A disk that takes no more is tried again after this time [s].
RETRY_S = 1.0
CHUNK_BYTES = 64 * 1024
# Turns that wait for a disk that has stopped; later ones are left out.
MOST_WAITING = 6000
NANOSECONDS = 1_000_000_000
TOPIC, SCHEMA = "kart/turn", "kart.Turn"
# Errors of MCAP, of JSON and of unpacking on a torn or foreign file: LZ4's are RuntimeErrors, and
# so is that of a message whose brackets go too deep.
_DAMAGES = (
    *(McapError, ValueError, struct.error, ZstdError, OverflowError, MemoryError, RuntimeError),
)


class BlackBox:
    """The file of one drive, while it is written."""

    def __init__(self, path: Path, ring: IncidentRing | None = None) -> None:
        """Begin the file. ring: holds back what is not kept; without one every turn is.

        Raises:
            RecordingError: it cannot be written.
        """
        try:
            self._file = KeptOutput(path)
        except OSError as error:
            raise RecordingError(f"black box {path} cannot be written: {error.strerror}") from error
        self._path, self._ends, self._has_said = path, threading.Event(), False
        stream = cast("IO[Any]", self._file)
        self._writer = Writer(stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD)
        self._writer.start("race-kart", f"race-server {__version__}")
        schema = json.dumps({"type": "object", "title": SCHEMA}).encode()
        number = self._writer.register_schema(SCHEMA, "jsonschema", schema)
        self._channel = self._writer.register_channel(TOPIC, "json", number)
        self._ring = ring
        self._queue: TicketQueue[list[Noted]] = TicketQueue("black box", self._work)
        self._queue.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def note(self, readings: Readings, unit: ControlUnit) -> None:
        """Hand a turn over; where the disk has stopped it is left out."""
        if self._queue.backlog >= MOST_WAITING:
            return
        at_ns = round(NANOSECONDS * readings.time_s)  # by the clock of the kart
        noted = [(at_ns, turn_of(readings, unit))]
        if self._ring is not None:
            happens = is_incident(readings, unit)
            noted = self._ring.pass_on(noted[0], readings.time_s, happens=happens)
        if noted:
            self._queue.put(noted)

    def close(self) -> None:
        """Write what is left, and end the file."""
        self._ends.set()
        self._queue.close()

    def _work(self) -> None:
        """Write until the last turn; runs in the thread."""
        try:
            if self._write_turns():
                self._writer.finish()
                self._drain()
        finally:
            with contextlib.suppress(OSError):
                self._file.close()

    def _write_turns(self) -> bool:
        """Write turns as they come, up to the last; False if the kart ends on a full disk."""
        flushed = time.monotonic()
        while True:
            with contextlib.suppress(queue.Empty):
                noted = self._queue.get(FLUSH_S)
                if noted is None:
                    return True
                self._write(noted)
            if time.monotonic() - flushed > FLUSH_S:
                self._writer.flush()
                if not self._drain():
                    return False
                flushed = time.monotonic()

    def _drain(self) -> bool:
        """Hand to the disk what is written, until it takes it; False if the kart ends before."""
        while True:
            try:
                self._file.drain()
            except OSError as error:
                if not self._has_said:
                    self._has_said = True
                    cause = f"{error.strerror}; it is tried again, and turns may be missing"
                    say(f"black box {self._path} cannot be written: {cause}", error=True)
                if self._ends.is_set():
                    return False
                self._ends.wait(RETRY_S)
            else:
                return True

    def _write(self, noted: list[Noted]) -> None:
        for at_ns, turn in noted:
            data = json.dumps(turn, separators=(",", ":")).encode()
            self._writer.add_message(self._channel, log_time=at_ns, publish_time=at_ns, data=data)
        self._queue.settle(1)


def turn_of(readings: Readings, unit: ControlUnit) -> Turn:
    """Return a turn as plain data; what is not known is left out, numbers are rounded."""
    fix, filtered, command = readings.fix, unit.fusion, unit.command
    turn: Turn = {
        "time_s": round(readings.time_s, 4),
        "wheel_speed": _rounded(readings.wheel_speed),
        "yaw_rate": _rounded(readings.yaw_rate),
        "steering": _rounded(readings.steering),
        "acceleration": None if readings.acceleration is None else _all(readings.acceleration),
        "fix": None if fix is None else _all((fix.x, fix.y, fix.deviation)),
        "echoes": None
        if readings.echoes is None
        else [
            _all(row)
            for row in zip(
                *(readings.echoes.x, readings.echoes.y, readings.echoes.closing),
                readings.echoes.kinds,
                strict=True,
            )
        ],
        "command": _all((command.steering, command.throttle, command.brake)),
        "cause": command.cause.as_json(),
        "sensors": [int(state) for state in unit.watch.states()],
        "alert": {**unit.alert().as_json(), "cause": None},
        "tracks": [
            {"state": _all(track.state), "kind": int(track.kind), "scans": track.scans}
            for track in unit.objects.tracks
        ],
    }
    if unit.others.peers:
        turn["peers"] = [
            {
                "age_s": _rounded(readings.time_s - 1e-6 * peer.stamp_us),
                "place": _all((peer.x, peer.y, peer.heading)),
                "speed": _rounded(peer.speed),
                "braking": _rounded(peer.braking),
            }
            for peer in unit.others.peers
        ]
    if filtered is not None:
        turn["state"] = _all(filtered.state)
        turn["variances"] = _all(filtered.filter.covariance.diagonal())
        turn["deviation"] = _rounded(filtered.deviation)
        turn["innovations"] = {
            sensor: _rounded(value) for sensor, value in filtered.filter.squares.items()
        }
    orders = unit.hud
    if orders is not None:
        turn["orders"] = {
            "sequence": orders.sequence,
            "speed_cap": _rounded(orders.speed_cap),
            "thrust_scale": _rounded(orders.thrust_scale),
        }
    return {name: value for name, value in turn.items() if value is not None}


def _rounded(value: float) -> float | None:
    return round(float(value), 5) if math.isfinite(value) else None


def _all(values: Any) -> list[float | None]:
    return [_rounded(value) for value in values]


def read_black_box(path: Path) -> Iterator[Turn]:
    """Yield the turns of a black box, up to where it is whole.

    Raises:
        RecordingError: it cannot be read, or is none.
    """
    try:
        with path.open("rb") as file:
            yield from _turns_in(file, path)
    except OSError as error:
        raise RecordingError(f"{path} cannot be read: {error.strerror}") from error


def _turns_in(file: BufferedReader, path: Path) -> Iterator[Turn]:
    topics: dict[int, str] = {}
    count = 0
    try:
        for record in StreamReader(file).records:
            if isinstance(record, Channel):
                topics[record.id] = record.topic
            elif isinstance(record, Message) and topics.get(record.channel_id) == TOPIC:
                turn: Turn = json.loads(record.data)
                count += 1
                if fault := fault_in(turn):
                    raise RecordingError(
                        f"{path} is no black box of a kart: message {count} of {TOPIC} {fault}"
                    )
                yield turn
    # The end is torn where the kart's program was killed.
    except _DAMAGES as error:
        if TOPIC not in topics.values():
            raise RecordingError(f"{path} is no black box of a kart: {error}") from error
    if TOPIC not in topics.values():
        raise RecordingError(f"{path} is no black box of a kart: no turn is in it")
