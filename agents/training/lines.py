"""Reference lines for a teacher: computed before a training, by several processes."""

import contextlib
import itertools
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import replace

from race_agents.training.worker_pool import worker_pool
from race_server.core.vehicles import Vehicle
from race_server.envs.racing.discipline import Racing
from race_server.envs.task import Task
from race_server.errors import RaceError
from race_server.scenario.race import Scenario
from race_server.scenario.raceline.attach import line_of
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.raceline.detour import around
from race_server.scenario.raceline.reference import known_limit, reference_limit
from race_server.scenario.track.course import Course

TOLD_S = 5.0  # between two lines that tell how many are computed

Say = Callable[[str], None]
Job = tuple[Course, Vehicle, float | None]  # and the margin [m]


def find_lines_shown(tasks: Iterable[Task], workers: int, say: Say) -> None:
    """Compute the lines that races show; without it their worlds do, one by one and silently."""
    races = [one for one in tasks if isinstance(one.discipline, Racing) and one.wants_line]
    find_lines([scenario for race in races for scenario in race.scenarios], None, workers, say)


def find_lines(
    scenarios: Sequence[Scenario], margin: float | None, workers: int, say: Say
) -> tuple[Scenario, ...]:
    """Return the scenarios with lines that keep a margin [m]; None: with lines as in a race.

    Lines are kept in the user's cache. If no line fits with the margin, that of a race is used.
    """
    jobs = [(one.course, one.vehicle_of(0), margin) for one in scenarios]
    # Fields of several sizes race on one course, which is another object where it is reversed.
    jobs = list({(job[0].name, job[0].digest, job[1]): job for job in jobs}.values())
    unknown = [job for job in jobs if known_limit(job[0], bounds_of(job[1], margin=margin)) is None]
    if unknown:
        say(f"reference lines: {len(unknown)} to compute, 1 to 20 s each")
        _find(unknown, workers, say)
    if margin is None:
        return tuple(scenarios)
    return tuple(_with_margin(scenario, margin) for scenario in scenarios)


def _find(jobs: Sequence[Job], workers: int, say: Say) -> None:
    told = time.monotonic()
    for number, _ in enumerate(_found(jobs, min(workers, len(jobs))), 1):
        if number == len(jobs) or time.monotonic() - told >= TOLD_S:
            told = time.monotonic()
            say(f"reference lines: {number} of {len(jobs)}")


def _found(jobs: Sequence[Job], workers: int) -> Iterator[None]:
    """Compute lines one after the other, and report each."""
    if workers == 1:
        yield from itertools.starmap(find_line, jobs)
        return
    with worker_pool(workers) as pool:
        for future in as_completed([pool.submit(find_line, *job) for job in jobs]):
            yield future.result()


def find_line(course: Course, vehicle: Vehicle, margin: float | None) -> None:
    """Compute a line and keep it in the user's cache; do nothing if there is none."""
    with contextlib.suppress(RaceError):
        reference_limit(course, vehicle, margin=margin)


def _with_margin(scenario: Scenario, margin: float) -> Scenario:
    course, vehicle = scenario.course, scenario.vehicle_of(0)
    bounds = bounds_of(vehicle, margin=margin)
    limit = known_limit(course, bounds)
    if limit is None:
        return scenario
    line = around(course, line_of(course, limit.with_room), bounds, vehicle)
    return replace(scenario, line=line)
