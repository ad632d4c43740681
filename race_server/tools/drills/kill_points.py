"""When a server is killed: at any moment, inside a commit, or inside the write of a chunk."""

import os
import random
import signal
import time
from enum import Enum
from pathlib import Path

# A file that is not written for this long is not waited for: the kill comes anyway.
PATIENCE_S = 5.0
# A write is a few system calls within this time; the kill falls somewhere into it.
WRITE_S = 0.0003


class KillPoint(Enum):
    """What the server is doing when it is killed."""

    ANY = "any"
    COMMIT = "commit"  # of a transaction, into the log of the results file
    CHUNK = "chunk"  # of messages, into the recording


def kill_at(point: KillPoint, process: int, files: dict[KillPoint, Path], delay_s: float) -> bool:
    """Kill a process, and return whether that was while it wrote the file of the point.

    delay_s: from the first byte of the write to the kill.
    """
    path = files.get(point)
    is_writing = path is not None and _is_written(path, PATIENCE_S)
    if is_writing:
        _spin(delay_s)
    os.kill(process, signal.SIGKILL)
    return is_writing


def draw_point(chance: random.Random) -> tuple[KillPoint, float]:
    """Return a random point, and a random delay into its write [s]."""
    return chance.choice(list(KillPoint)), chance.uniform(0.0, WRITE_S)


def _is_written(path: Path, timeout_s: float) -> bool:
    """Return as soon as the next bytes of a file are written; False where none are in time."""
    before, deadline = _state_of(path), time.monotonic() + timeout_s
    while time.monotonic() < deadline:
        if _state_of(path) != before:
            return True
    return False


def _state_of(path: Path) -> tuple[int, int]:
    try:
        about = path.stat()
    except OSError:
        return 0, 0
    return about.st_size, about.st_mtime_ns


def _spin(seconds: float) -> None:
    deadline = time.perf_counter() + seconds
    while time.perf_counter() < deadline:
        pass
