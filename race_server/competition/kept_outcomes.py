"""Outcomes of tasks that exams keep in the user's cache, so that nothing is driven twice."""

import contextlib
import hashlib
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

from race_server.core.kernels.jit import cache_root, source_digest
from race_server.core.kernels.sources import PACKAGE
from race_server.kept_file import keep
from race_server.scenario.raceline.reference import solver_digest

Outcome = TypeVar("Outcome")

# What decides an outcome besides kernels, drivers and the solver: folders and files of the package.
DECIDING = (
    *("competition", "scenario", "second", "session"),
    *("live/local_drivers.py", "net/wire/drive.py"),
)


def place_of(exam: str, *words: object) -> Path:
    """Return the file of a task: by all that decides its outcome.

    Besides the words those are the compiled code, the solver of lines, and the code that makes
    tasks, drives them and judges what was driven.
    """
    code = source_digest(), solver_digest(), deciding_digest(PACKAGE)
    text = " ".join(str(word) for word in (*code, *words))
    digest = hashlib.sha256(text.encode()).hexdigest()[:24]
    return cache_root() / exam / f"{digest}.json"


@cache
def deciding_digest(package: Path) -> str:
    """Return a digest of the files of DECIDING in a package."""
    digest = hashlib.sha256()
    for name in DECIDING:
        place = package / name
        for path in [place] if place.is_file() else sorted(place.rglob("*.py")):
            digest.update(str(path.relative_to(package)).encode())
            digest.update(path.read_bytes())
    return digest.hexdigest()


def kept_in(path: Path, make: Callable[[dict[str, Any]], Outcome]) -> Outcome | None:
    """Return what a function makes of a file, None if there is none that can be read."""
    with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
        return make(json.loads(path.read_text(encoding="utf-8")))
    return None


def keep_outcome(path: Path, words: dict[str, Any]) -> None:
    """Keep the outcome of a task."""
    text = json.dumps(words).encode()
    keep(path, lambda file: file.write(text))
