"""Where recordings lie: the journal of the race that is being driven, and those that are over.

A journal is called ``<session>.journal.mcap`` while its race lasts. A server that starts and finds
one resumes it: the server that wrote it was killed. At the end it gets the time of the race as its
name.
"""

import contextlib
import fcntl
import os
import tempfile
from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import IO, Self

from race_server.errors import RecordingError
from race_server.kept_file import free_aside
from race_server.net.wire.journal import StartFrame
from race_server.storage.recording.reader import (
    NANOSECONDS,
    Line,
    Recording,
    read_lines,
    read_recording,
)
from race_server.storage.recording.recorder import Recorder
from race_server.user_data import path_named, user_data

VARIABLE = "RACE_SERVER_RECORDINGS"
NOWHERE = "none"
# When a race began, in the name of its recording.
STAMP = "????????-??????-???"
# At most this many servers at once may serve sessions of the same name, each with its own journal.
MOST_NAMESAKES = 16


def folder_of(words: str) -> Path | None:
    """Return the folder that an option names: the default where it is empty, None for `none`.

    Raises:
        ScenarioError: it is in the home of no user.
    """
    words = words or os.environ.get(VARIABLE, "")
    if words:
        return None if words == NOWHERE else path_named(words)
    return user_data("recordings")


def check_folder(folder: Path) -> None:
    """Make a folder, and check before anything is driven that recordings can be written there.

    Raises:
        RecordingError: they cannot.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        raise _unwritable(folder, error) from error


def _unwritable(folder: Path, error: OSError) -> RecordingError:
    return RecordingError(
        f"recordings cannot be written to {folder} ({error.strerror or error}); name another "
        "folder with --record FOLDER, or race without: --record none"
    )


def recordings_of(folder: Path, session: str) -> list[Path]:
    """Return the recordings of the races of a session that are over, oldest first."""
    return sorted(folder.glob(f"{session}-{STAMP}.mcap"))


class Logbook:
    """The recordings of one session; no other server writes to its journal."""

    def __init__(self, folder: Path, session: str, log: Callable[[str], None]) -> None:
        """Find a journal that no other server writes.

        log: called once if a recording fails.

        Raises:
            RecordingError: the folder cannot be written.
        """
        self.folder = folder
        self._log = log
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock, self.session = _locked(folder, session)
        except OSError as error:
            raise _unwritable(folder, error) from error
        self._unfiled = ""  # when the race began that is over, and still in the journal
        self._part = folder / f"{self.session}.part.mcap"
        self.journal = folder / f"{self.session}.journal.mcap"

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._lock.close()

    def unfinished(self) -> Recording | None:
        """Return the race that a server which was killed has left, if there is one.

        What cannot be read is put aside, and said.
        """
        with contextlib.suppress(OSError):
            self._part.unlink(missing_ok=True)
        if not self.journal.exists():
            return None
        try:
            recording = read_recording(self.journal)
        except RecordingError as error:
            self._move_aside(str(error), "unreadable")
            return None
        if recording.is_complete:
            self._file_away(recording.start.started_at)
            return None
        return recording

    def put_aside(self, why: str) -> None:
        """Keep a journal that cannot be taken up, and say so."""
        self._move_aside(why, "aside")

    def _move_aside(self, why: str, word: str) -> None:
        aside = free_aside(self.journal, word, ".mcap")
        try:
            self.journal.replace(aside)
        except OSError as error:
            self._log(f"{why}; the journal stays where it is ({error.strerror or error})")
        else:
            self._log(f"{why}; the journal is kept as {aside}")

    def begin(self, frame: StartFrame, *, takes_up: bool = False) -> Recorder | None:
        """Return a recorder for a race; one that is taken up begins with its old journal.

        That the file cannot be made is said, and there is no recorder; also where the race before
        is still in the journal.
        """
        if self._unfiled:
            self._file_away(self._unfiled)
        if self._unfiled:
            return None
        path = self._part if takes_up else self.journal
        try:
            return self._recorder(path, frame, takes_up=takes_up)
        except (OSError, RecordingError) as error:
            why = f"recording {path} cannot be written ({error}). The race goes on without it"
            if takes_up:
                self.put_aside(why)
            else:
                self._log(why)
        return None

    def _recorder(self, path: Path, frame: StartFrame, *, takes_up: bool) -> Recorder:
        begun_ns = round(datetime.fromisoformat(frame.started_at).timestamp() * NANOSECONDS)
        recorder = Recorder(path.open("wb"), frame.session, begun_ns, self._log)
        if not takes_up:
            recorder.begin(frame)
            return recorder
        lines = (line for line in read_lines(self.journal) if isinstance(line, Line))
        # Until it is copied the old journal is the one that counts.
        if not recorder.copy_all(lines):
            raise RecordingError(f"{self.journal} cannot be copied")
        path.replace(self.journal)
        return recorder

    def end(self, recorder: Recorder, frame: StartFrame) -> Path:
        """Close a recording and return where it lies now; it is said if it is still the journal."""
        recorder.close()
        return self._file_away(frame.started_at)

    def _file_away(self, started_at: str) -> Path:
        stamp = datetime.fromisoformat(started_at).strftime("%Y%m%d-%H%M%S-%f")[:-3]
        path = self.folder / f"{self.session}-{stamp}.mcap"
        try:
            self.journal.replace(path)
        except OSError as error:
            self._unfiled = started_at
            self._log(
                f"recording {self.journal} cannot be renamed to {path.name} "
                f"({error.strerror or error}); no other race is recorded until it can"
            )
            return self.journal
        self._unfiled = ""
        return path


def _locked(folder: Path, session: str) -> tuple[IO[bytes], str]:
    """Return a lock, held as long as it is open, and the name that it stands for."""
    for number in range(1, MOST_NAMESAKES + 1):
        name = session if number == 1 else f"{session}~{number}"
        lock = (folder / f".{name}.lock").open("wb")
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            lock.close()
            continue
        return lock, name
    raise RecordingError(
        f"{MOST_NAMESAKES} servers already record sessions called {session!r} in {folder}; "
        "choose another name with --session"
    )
