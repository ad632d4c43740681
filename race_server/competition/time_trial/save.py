"""Save a trial: each run is a race of one kart in the results file, each lap has its trace."""

import contextlib
from pathlib import Path
from typing import Self

import numpy as np

from race_server.competition.time_trial.gaps import GAPS, NONE
from race_server.competition.time_trial.lap import COLUMNS
from race_server.competition.time_trial.run import Run
from race_server.competition.time_trial.run_spec import rules_of
from race_server.core.vehicle_presets import vehicle_named
from race_server.errors import ResultsError
from race_server.scenario.track.load import load_course
from race_server.session.lap_log import Lap
from race_server.storage.results.keeper import driver_version, rules_version
from race_server.storage.results.store import (
    FINISHED,
    STOPPED,
    Change,
    Entry,
    Outcome,
    Race,
    Store,
    Trace,
)
from race_server.version import __version__

PACE = "trial"


class RunLog:
    """Writes runs as they finish; a failed write is retried with the next run, never dropped."""

    def __init__(self, path: Path | None) -> None:
        """Open the results file; None keeps nothing.

        Raises:
            ResultsError: it is locked, damaged, newer, or cannot be written.
        """
        self._store = Store(path) if path is not None else None
        self._waiting: list[Change] = []
        self.path = path
        self.problem = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        if self._store is not None:
            self._store.close()

    def add(self, run: Run) -> None:
        """Write a run, and those whose write failed before."""
        if self._store is None or run.standing is None:
            return
        self._waiting += changes_of(run)
        with contextlib.suppress(ResultsError):
            self._write()

    def _write(self) -> None:
        assert self._store is not None
        if self._waiting:
            self._store.write(self._waiting)
            self._waiting.clear()

    def finish(self) -> Path | None:
        """Write what is left; return the other file used if the first one cannot be written.

        Raises:
            ResultsError: neither can be written.
        """
        if self._store is None or self.path is None:
            return None
        try:
            self._write()
        except ResultsError as error:
            self.problem = str(error)
            beside = _free_name(self.path)
            with Store(beside) as other:
                other.write(self._waiting)
            self._waiting.clear()
            return beside
        return None


def _free_name(path: Path) -> Path:
    number = 1
    while (beside := path.with_name(f"{path.stem}-trial-{number}{path.suffix}")).exists():
        number += 1
    return beside


def vehicle_words(run: Run) -> str:
    """Return the name of the vehicle, followed by its reality gap if it has one."""
    gap = run.spec.gap
    if gap == NONE:
        return run.spec.vehicle
    return f"{run.spec.vehicle} ({gap.name if gap.name in GAPS else gap.words()})"


def changes_of(run: Run) -> list[Change]:
    """Return a run as changes of the results file."""
    spec, course = run.spec, load_course(run.spec.track)
    assert run.standing is not None
    vehicle = vehicle_words(run)
    race = Race(
        started_at=run.started_at,
        session=f"{spec.start} start",
        track=course.name,
        track_digest=course.digest,
        vehicle=vehicle,
        laps=spec.laps,
        pace=PACE,
        seed=spec.seed,
        rules_version=rules_version(rules_of(spec, course, vehicle_named(spec.vehicle))),
        server_version=__version__,
        entries=(Entry(0, spec.driver, driver_version(spec.driver), vehicle),),
    )
    changes: list[Change] = [race]
    for lap in run.laps:
        changes.append(Lap(0, lap.number, lap.time_us, lap.sectors_us, lap.is_clean))
        changes.append(Trace(0, lap.number, COLUMNS, lap.trace.astype(np.float32)))
    ended = STOPPED if run.failed else FINISHED
    changes.append(Outcome(run.digest, ended, (run.standing,)))
    return changes
