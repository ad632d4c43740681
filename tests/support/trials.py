"""A short trial, and a results file with its runs."""

from pathlib import Path

from race_server.competition.time_trial.run import Run
from race_server.competition.time_trial.run_spec import RunSpec
from race_server.competition.time_trial.save import RunLog

OVAL = RunSpec("follow_gap", "oval", laps=1)
PLACE = ("oval", "tt02")


def keep(path: Path, *runs: Run) -> None:
    with RunLog(path) as ledger:
        for run in runs:
            ledger.add(run)
        assert ledger.finish() is None
