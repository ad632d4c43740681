"""Outcomes of tasks that exams keep in the user's cache, so that nothing is driven twice."""

import contextlib
import hashlib
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

from race_server.core.kernels.jit import cache_root, source_digest
from race_server.kept_file import keep
from race_server.scenario.raceline.reference import solver_digest

Outcome = TypeVar("Outcome")


def place_of(exam: str, *words: object) -> Path:
    """Return the file of a task: by all that decides its outcome.

    Besides the words those are the compiled code and the solver of lines.
    """
    text = " ".join(str(word) for word in (source_digest(), solver_digest(), *words))
    digest = hashlib.sha256(text.encode()).hexdigest()[:24]
    return cache_root() / exam / f"{digest}.json"


def kept_in(path: Path, make: Callable[[dict[str, Any]], Outcome]) -> Outcome | None:
    """Return what a function makes of a file, None if there is none that can be read."""
    with contextlib.suppress(OSError, ValueError, TypeError, KeyError):
        return make(json.loads(path.read_text(encoding="utf-8")))
    return None


def keep_outcome(path: Path, words: dict[str, Any]) -> None:
    """Keep the outcome of a task."""
    text = json.dumps(words).encode()
    keep(path, lambda file: file.write(text))
