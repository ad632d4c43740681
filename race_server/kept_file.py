"""Files that are whole or not there, and places where a file can be written."""

import contextlib
import errno
import itertools
import os
import tempfile
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import IO

from race_server.errors import ScenarioError


def check_place(path: Path) -> None:
    """Check, before what it is to hold is worked out, that there is a place for a file.

    Raises:
        ScenarioError: it is a folder, or its folder does not exist or takes no files.
    """
    if path.is_dir():
        raise ScenarioError(f"{path}: is a folder; name a file")
    if not path.absolute().parent.is_dir():
        raise ScenarioError(f"{path}: its folder does not exist; make it first")
    if not os.access(path if path.exists() else path.absolute().parent, os.W_OK):
        raise ScenarioError(f"{path}: cannot be written here; name another folder")


def keep(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Let a function write a file aside and move it, so that no reader sees half of it.

    It is of the user's cache: no loss if it cannot be written.
    """
    with contextlib.suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent)
        try:
            with os.fdopen(handle, "wb") as file:
                write(file)
            Path(name).replace(path)
        finally:  # on a full disk, or with Ctrl-C, half a file stays behind otherwise
            Path(name).unlink(missing_ok=True)


def free_aside(path: Path, word: str, suffix: str) -> Path:
    """Return a free name for a file that is put aside: with a word and a number before its suffix.

    What was put aside before may still be wanted.
    """
    stem = path.name.removesuffix(suffix)
    numbered = (f"{stem}.{word}{f'-{n}' * (n > 1)}{suffix}" for n in itertools.count(1))
    return next(free for free in map(path.with_name, numbered) if not free.exists())


def part_of(path: Path) -> Path:
    """Return the name under which this process writes a file before it is complete.

    Another process may write the same file at the same time.
    """
    return path.with_name(f"{path.name}.{os.getpid()}.part")


def write_file(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Let a function write a file aside, and move it once it is complete.

    What cannot be replaced is written in place: a pipe, the name of an open file such as
    /dev/stdout, and a file whose folder takes no other.

    Raises:
        OSError: it cannot be written; a file that could be replaced is left as it was.
    """
    if path.exists() and not _can_be_replaced(path):
        with path.open("wb") as file:
            write(file)
    else:
        _write_aside({path.resolve(): write})


def write_together(files: Mapping[Path, bytes]) -> None:
    """Write files aside, and move them when all are complete.

    One that is stopped before leaves none behind.

    Raises:
        OSError: one cannot be written.
    """
    _write_aside({path: partial(_write_all, data) for path, data in files.items()})


def _write_all(data: bytes, file: IO[bytes]) -> None:
    file.write(data)


def _can_be_replaced(path: Path) -> bool:
    is_open = path.absolute().parts[1:2] in {("dev",), ("proc",)}
    return path.is_file() and not is_open and os.access(path.resolve().parent, os.W_OK)


def _write_aside(writers: Mapping[Path, Callable[[IO[bytes]], object]]) -> None:
    try:
        for path, write in writers.items():
            with part_of(path).open("wb") as file:
                write(file)
                file.flush()
                os.fsync(file.fileno())  # else a power cut may leave an empty file of that name
        for path in filter(Path.is_dir, writers):
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
        for path in writers:
            part_of(path).replace(path)
    finally:
        for path in writers:
            with contextlib.suppress(OSError):
                part_of(path).unlink(missing_ok=True)
