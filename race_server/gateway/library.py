"""The recordings that browsers may open: those in one folder, by name, and no other file."""

import json
import threading
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from race_server.clock import TICKS_PER_SECOND
from race_server.errors import GatewayError, RecordingError, WireError
from race_server.messages import Event
from race_server.recording.tape import Tape
from race_server.wire.spectate import decode_events

ENDING = ".mcap"
# A race that is being driven, and one that is taken up: not yet a recording.
_NOT_YET = (".journal.mcap", ".part.mcap")
# The newest so many are listed, and of so many all events are kept.
MOST_LISTED, MOST_KEPT = 100, 4

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
    """The recordings of a folder. Its methods read files: call them from the pool."""

    def __init__(self, folder: Path | None) -> None:
        """Look at a folder, or at none."""
        self._folder = folder
        self._titles: dict[Stamp, Title | None] = {}
        self._events: dict[Stamp, list[Event]] = {}
        self._lock = threading.Lock()

    def titles(self) -> list[dict[str, Any]]:
        """Return the newest recordings, newest first."""
        files = sorted(self._files(), key=lambda path: path.stat().st_mtime_ns, reverse=True)
        with self._lock:
            found = [self._title(path) for path in files[:MOST_LISTED]]
        return [asdict(title) for title in found if title is not None]

    def open(self, name: str) -> tuple[Tape, list[Event]]:
        """Return a recording and all events of its race.

        Raises:
            GatewayError: no recording has that name, or it cannot be read.
        """
        # A name is looked for among those that are there, never put into a path.
        for path in self._files():
            if path.name.removesuffix(ENDING) == name:
                try:
                    tape = Tape(path)
                except RecordingError as error:
                    raise GatewayError("no-recording", str(error)) from error
                return tape, self._events_of(path, tape)
        raise GatewayError(
            "no-recording", f"no recording is called {name[:80]!r}; choose one from the list"
        )

    def _files(self) -> list[Path]:
        if self._folder is None:
            return []
        try:
            return [
                path
                for path in self._folder.iterdir()
                if path.name.endswith(ENDING)
                and not path.name.endswith(_NOT_YET)
                and not path.is_symlink()
                and path.is_file()
            ]
        except OSError:
            return []

    def _title(self, path: Path) -> Title | None:
        stamp = _stamp(path)
        if stamp not in self._titles:
            self._titles[stamp] = _title_of(path)
        return self._titles[stamp]

    def _events_of(self, path: Path, tape: Tape) -> list[Event]:
        stamp = _stamp(path)
        with self._lock:
            if stamp not in self._events:
                while len(self._events) >= MOST_KEPT:
                    del self._events[next(iter(self._events))]
                self._events[stamp] = _all_events(tape)
            return self._events[stamp]


def _stamp(path: Path) -> Stamp:
    about = path.stat()
    return path.name, about.st_mtime_ns, about.st_size


def _title_of(path: Path) -> Title | None:
    """Return the line of a recording, None for a file that is none."""
    try:
        tape = Tape(path)
    except RecordingError:
        return None
    try:
        return Title(
            name=path.name.removesuffix(ENDING),
            course=str(json.loads(tape.start.setting)["course"]["name"]),
            started=tape.start.started_at,
            seconds=round(tape.last_tick / TICKS_PER_SECOND, 1),
            karts=len(tape.start.seats),
            finished=tape.is_finished(),
        )
    except (ValueError, KeyError, TypeError, WireError):
        return None
    finally:
        tape.close()


def _all_events(tape: Tape) -> list[Event]:
    """Return all events of a recording, each once; damaged messages are left out."""
    events: dict[int, Event] = {}
    for moment in tape.all_events():
        try:
            _, told = decode_events(moment.data)
        except WireError:
            continue
        events.update((event.sequence, event) for event in told)
    return sorted(events.values(), key=lambda event: event.sequence)
