"""Sessions of a race on a ring."""

from typing import Any

from race_server.scenario.race import Rules, Scenario
from race_server.scenario.track.course import Course
from race_server.session.session import Session
from support.courses import SMALL_RING


def session_on_ring(
    name: str, karts: int = 2, *, seed: int = 0, course: Course = SMALL_RING, **rules: Any
) -> Session:
    """Return a session in its lobby. rules: those that differ from the usual ones."""
    return Session(name, Scenario(course, karts=karts, seed=seed, rules=Rules(**rules)))
