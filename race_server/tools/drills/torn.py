"""Whether a file ends inside a chunk of a recording, or inside a commit of a results file."""

import struct
from collections.abc import Iterator
from pathlib import Path

from mcap.opcode import Opcode

from race_server.storage.recording.chunks import HEAD, MAGIC

# Of SQLite's log (sqlite.org/fileformat2.html), in bytes: its head, and the head of a frame. The
# page size stands in the first, the number of pages after a commit in the second.
WAL_HEAD, FRAME_HEAD = 32, 24
PAGE_SIZE_AT, COMMIT_AT = 8, 4


def chunk_ends(data: bytes) -> list[int]:
    """Return where each whole chunk of a recording ends [bytes]."""
    return [end for opcode, end in _record_ends(data) if opcode == Opcode.CHUNK]


def is_torn(path: Path) -> bool:
    """Return whether a recording, or a log of SQLite, ends inside a record or a commit."""
    try:
        data = path.read_bytes()
    except OSError:
        return False
    if path.suffix == ".mcap":
        last = max((end for _, end in _record_ends(data)), default=len(MAGIC))
    else:
        last = max(commit_ends(data), default=WAL_HEAD) if len(data) > WAL_HEAD else 0
    return last < len(data)


def _record_ends(data: bytes) -> Iterator[tuple[int, int]]:
    at = len(MAGIC)
    while at + HEAD.size <= len(data):
        opcode, length = HEAD.unpack_from(data, at)
        at += HEAD.size + length
        if at <= len(data):
            yield opcode, at


def commit_ends(log: bytes) -> list[int]:
    """Return where each whole commit in a log of SQLite ends [bytes]."""
    (page,) = struct.unpack_from(">I", log, PAGE_SIZE_AT)
    frame = FRAME_HEAD + page
    starts = range(WAL_HEAD, len(log) - frame + 1, frame)
    return [
        start + frame for start in starts if struct.unpack_from(">I", log, start + COMMIT_AT)[0]
    ]
