"""The recordings that browsers may open: those of one folder, by name, and no other file."""

import json
import threading
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.messages import Event
from race_server.errors import GatewayError, RecordingError, WireError
from race_server.live.client.event_stream import EventStream
from race_server.live.gateway.limits import GatewayLimits
from race_server.net.wire.spectate import decode_events
from race_server.printable import printable
from race_server.storage.recording.seekable import SeekableRecording

ENDING = ".mcap"
# Files of a race that goes on, or is resumed: not yet a recording.
_NOT_YET = (".journal.mcap", ".part.mcap")
# Events of one recording that are read.
MAX_EVENTS = 1 << 20

Stamp = tuple[str, int, int]  # name, time of the last change [ns], size


@dataclass(frozen=True)
class Title:
    """One line of the list of recordings."""

    name: str
    course: str
    started: str  # UTC, ISO 8601
    seconds: float
    karts: int
    finished: bool


class Library:
    """The recordings of a folder. Its methods read files: call them from a thread."""

    def __init__(self, folder: Path | None, limits: GatewayLimits) -> None:
        """Serve the recordings of a folder; None has none."""
        self._folder, self._limits = folder, limits
        self._titles: dict[Stamp, Title | None] = {}
        self._events: dict[Stamp, list[Event]] = {}
        self._lock = threading.Lock()

    def titles(self) -> list[dict[str, Any]]:
        """Return the newest recordings, newest first."""
        files = sorted(self._files().items(), key=lambda file: file[1][1], reverse=True)
        with self._lock:
            found = [
                self._title(path, stamp) for path, stamp in files[: self._limits.listed_recordings]
            ]
        return [asdict(title) for title in found if title is not None]

    def open(self, name: str) -> tuple[SeekableRecording, list[Event]]:
        """Return a recording and all events of its race.

        Raises:
            GatewayError: no recording has that name, or it cannot be read.
        """
        # A name is compared with those of the files, never made into a path.
        for path, stamp in self._files().items():
            if path.name.removesuffix(ENDING) == name:
                try:
                    recording = SeekableRecording(path)
                except RecordingError as error:
                    raise GatewayError("no-recording", str(error)) from error
                return recording, self._events_of(stamp, recording)
        raise GatewayError(
            "no-recording", f"no recording is called {name[:80]!r}; choose one from the list"
        )

    def _files(self) -> dict[Path, Stamp]:
        if self._folder is None:
            return {}
        try:
            paths = list(self._folder.iterdir())
        except OSError:
            return {}
        stamps = {path: _stamp(path) for path in paths if _is_recording(path)}
        return {path: stamp for path, stamp in stamps.items() if stamp is not None}

    def _title(self, path: Path, stamp: Stamp) -> Title | None:
        if stamp not in self._titles:
            self._titles[stamp] = _title_of(path)
        return self._titles[stamp]

    def _events_of(self, stamp: Stamp, recording: SeekableRecording) -> list[Event]:
        with self._lock:
            if stamp not in self._events:
                while len(self._events) >= self._limits.cached_recordings:
                    del self._events[next(iter(self._events))]
                self._events[stamp] = _all_events(recording)
            return self._events[stamp]


def _is_recording(path: Path) -> bool:
    has_name = path.name.endswith(ENDING) and not path.name.endswith(_NOT_YET)
    # A name that is no text can be told to no browser, and asked for by none.
    return has_name and path.name.isprintable() and not path.is_symlink() and path.is_file()


def _stamp(path: Path) -> Stamp | None:
    """Return what tells a file from an earlier one of its name, None where it was just deleted."""
    try:
        about = path.stat()
    except OSError:
        return None
    return path.name, about.st_mtime_ns, about.st_size


def _title_of(path: Path) -> Title | None:
    """Return the line of a recording, None for a file that cannot be read."""
    try:
        recording = SeekableRecording(path)
    except RecordingError:
        return None
    try:
        return Title(
            name=path.name.removesuffix(ENDING),
            course=printable(str(json.loads(recording.start.setting)["course"]["name"])),
            started=recording.start.started_at,
            seconds=round(recording.last_tick / TICKS_PER_SECOND, 1),
            karts=len(recording.start.seats),
            finished=recording.is_finished(),
        )
    # Text of a thousand brackets is no JSON either.
    except (ValueError, KeyError, TypeError, RecursionError, WireError):
        return None
    finally:
        recording.close()


def _all_events(recording: SeekableRecording) -> list[Event]:
    """Return all events of a recording, each once; damaged messages are left out."""
    stream = EventStream(MAX_EVENTS, recording.start.epoch)
    for moment in recording.all_events():
        with suppress(WireError):
            stream.receive(recording.start.epoch, decode_events(moment.data)[1])
    return stream.recent()
