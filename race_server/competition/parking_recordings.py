"""Tasks of an exam that failed, driven again in a session, so that recordings of them are played.

The session is the lot's, with the seed of the task's round, the exam's interval of decisions and
the driver inside. It has no delay of controls, and a driver that shares its way with others does so
where it is alone, too: the same task, in which it may fare better or worse than in the exam.
"""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from race_server.competition.launch import free_address
from race_server.competition.parking_exam import DECISION_TICKS, ExamSpec, Try
from race_server.core.messages import Ending
from race_server.errors import DriverError, RecordingError
from race_server.live.server import LOCKSTEP, RaceServer
from race_server.net.transport import ServerLink
from race_server.scenario.race import Scenario
from race_server.session.session import Session
from race_server.storage.recording.logbook import Logbook, recordings_of

MOST_LETTERS = 32  # of the name of a session


@dataclass(frozen=True)
class Recorded:
    """One task that was driven again."""

    seed: int
    path: Path
    endings: tuple[Ending, ...]  # of each vehicle


def record_tasks(
    spec: ExamSpec, driver: str, tries: Sequence[Try], folder: Path, log: Callable[[str], None]
) -> Iterator[Recorded]:
    """Drive the tasks of some tries in sessions, each once, and yield their recordings.

    log: is told of a recording that fails, and of a driver that fails before it drives, of whose
    task there is none.

    Raises:
        RecordingError: the folder cannot be written, or a recording has failed.
        RaceError: the driver cannot drive there.
    """
    rounds = {one.seed: one.round_seed for one in tries}
    for seed, round_seed in sorted(rounds.items()):
        scenario = replace(spec.scenario_of(), seed=round_seed)
        name = _name_of(scenario.course.name, seed)
        try:
            recorded = _record(scenario, driver, seed, name, folder, log)
        except DriverError as error:
            log(f"seed {seed} is not recorded: {error}")
        else:
            yield recorded


def _name_of(lot: str, seed: int) -> str:
    """Return a valid name of a session; the seed is always whole."""
    plain = re.sub(r"[^A-Za-z0-9_.-]", "-", lot).lstrip("-_.") or "lot"
    return f"{plain[: MOST_LETTERS - len(f'-{seed}')]}-{seed}"


def _record(
    scenario: Scenario, driver: str, seed: int, name: str, folder: Path, log: Callable[[str], None]
) -> Recorded:
    session = Session(name, scenario, decision_ticks=DECISION_TICKS)
    with (
        Logbook(folder, name, log) as book,
        ServerLink(free_address(), name, scenario.karts) as link,
    ):
        before = recordings_of(folder, book.session)
        result = RaceServer(session, link, LOCKSTEP, (driver,), logbook=book).run(0)
        # Others may record into the folder, too, but none of this name.
        written = set(recordings_of(folder, book.session)) - set(before)
    assert result is not None
    if not written:
        raise RecordingError(f"seed {seed} was driven, and no recording of it is in {folder}")
    (path,) = written
    endings = tuple(row.parking.ending for row in result.standings if row.parking)
    return Recorded(seed, path, endings)
