"""A cache of built courses: the medial line of blocks takes a second."""

import contextlib
import hashlib
import pickle
from collections.abc import Callable
from functools import cache
from pathlib import Path

from race_server.core.kernels.jit import cache_root
from race_server.kept_file import keep
from race_server.scenario.track.course import Course
from race_server.scenario.track.limits import check_sizes


@cache
def _sources() -> str:
    """Return a digest of the code that builds courses."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def cached(digest: str, build: Callable[[], Course]) -> Course:
    """Return the course of a file's digest from the cache, or build and store it."""
    path = cache_root() / "courses" / f"{digest}-{_sources()}.pickle"
    # The cache is in the user's folder and written by us; what cannot be read is built again,
    # whatever damage, or another version of numpy, makes the reader trip over.
    with contextlib.suppress(Exception):
        course = pickle.loads(path.read_bytes())
        if isinstance(course, Course):
            check_sizes(course)
            return course
    course = build()
    keep(path, lambda file: pickle.dump(course, file))
    return course
