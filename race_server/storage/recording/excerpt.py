"""The first part of a recording as a separate recording."""

import contextlib
from collections.abc import Iterator
from itertools import chain, takewhile
from pathlib import Path

from race_server.core.clock import TICKS_PER_SECOND
from race_server.errors import RecordingError
from race_server.kept_file import part_of
from race_server.net.wire.journal import decode_start
from race_server.storage.recording.channels import START
from race_server.storage.recording.reader import NANOSECONDS, Line, read_lines
from race_server.storage.recording.recorder import Recorder


def write_excerpt(source: Path, target: Path, until_s: float) -> int:
    """Copy what lies before a time [s] and return how many ticks that are.

    The target is there once it is complete.

    Raises:
        RecordingError: the source is no recording, or the target exists or cannot be written.
    """
    if not until_s > 0.0:
        raise RecordingError(f"a part of {until_s:g} s is none; choose more with --until")
    if target.exists():
        raise _unwritable(target, "File exists")
    whole = takewhile(lambda line: line is not None, read_lines(source))
    lines = (line for line in whole if isinstance(line, Line))
    start = next((line for line in lines if line.kind is START), None)
    if start is None:
        raise RecordingError(f"recording {source} does not hold the beginning of a race")
    part = part_of(target)
    try:
        last_ns = _copy(part, start, lines, until_s)
        part.rename(target)
    except OSError as error:
        raise _unwritable(target, error.strerror or str(error)) from error
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
    return round((last_ns - start.time_ns) * TICKS_PER_SECOND / NANOSECONDS)


def _copy(part: Path, start: Line, lines: Iterator[Line], until_s: float) -> int:
    """Copy a race into a file, and return the time [ns] of the last message.

    Raises:
        OSError: the file cannot be written.
    """
    last_ns = start.time_ns

    def wanted() -> Iterator[Line]:
        nonlocal last_ns
        for line in chain([start], lines):
            if line.time_ns - start.time_ns < until_s * NANOSECONDS:
                last_ns = max(last_ns, line.time_ns)
                yield line

    recorder = Recorder(
        part.open("wb"), decode_start(start.data).session, start.time_ns, lambda _: None
    )
    with recorder:
        is_written = recorder.copy_all(wanted())
    if recorder.fault or not is_written:
        raise OSError(recorder.fault or "the disk has stopped")
    return last_ns


def _unwritable(target: Path, why: str) -> RecordingError:
    return RecordingError(f"{target} cannot be written ({why}); name another file")
