"""The first part of a recording as a separate recording."""

from pathlib import Path

from race_server.core.clock import TICKS_PER_SECOND
from race_server.errors import RecordingError
from race_server.net.wire.journal import decode_start
from race_server.storage.recording.channels import START
from race_server.storage.recording.reader import NANOSECONDS, Line, read_lines
from race_server.storage.recording.recorder import Recorder


def write_excerpt(source: Path, target: Path, until_s: float) -> int:
    """Copy what lies before a time [s] and return how many ticks that are.

    Raises:
        RecordingError: the source is no recording, or the target exists or cannot be written.
    """
    if not until_s > 0.0:
        raise RecordingError(f"a part of {until_s:g} s is none; choose more with --until")
    recorder: Recorder | None = None
    begun_ns = last_ns = 0
    for line in read_lines(source):
        if not isinstance(line, Line):
            break
        if line.kind is START:
            begun_ns = line.time_ns
            recorder = _recorder(target, decode_start(line.data).session, begun_ns)
        if recorder is None or line.time_ns - begun_ns >= until_s * NANOSECONDS:
            continue
        recorder.copy(line)
        last_ns = max(last_ns, line.time_ns)
    if recorder is None:
        raise RecordingError(f"recording {source} does not hold the beginning of a race")
    recorder.close()
    return (last_ns - begun_ns) * TICKS_PER_SECOND // NANOSECONDS


def _recorder(target: Path, session: str, begun_ns: int) -> Recorder:
    failures: list[str] = []
    try:
        file = target.open("xb")
    except OSError as error:
        raise RecordingError(
            f"{target} cannot be written ({error.strerror or error}); name another file"
        ) from error
    return Recorder(file, session, begun_ns, failures.append)
