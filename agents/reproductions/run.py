"""Run a reproduction: its trainings, table and plot."""

import json
from collections.abc import Callable, Iterator
from concurrent.futures import as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path
from typing import Any

from race_agents.reproductions.plan import Reproduction, TrainingScale
from race_agents.reproductions.plot import draw
from race_agents.reproductions.summary import VariantSummary, lines_of, remarks_on
from race_agents.reproductions.table import page, scale_words
from race_agents.reproductions.training import (
    Training,
    read_outcome,
    run_training,
    trainings_of,
    write_outcome,
)
from race_agents.training.folder import versions
from race_agents.training.worker_pool import worker_pool
from race_server.errors import RaceError, ScenarioError
from race_server.kept_file import write_together

CELLS, TABLE, FIGURES, PLOT = "cells", "README.md", "table.json", "plot.png"


@dataclass(frozen=True)
class ReproductionProgress:
    """Progress of a reproduction."""

    done: float  # trainings, with the share of the present one
    trainings: int
    name: str  # of the training


Tell = Callable[[ReproductionProgress], None]


@dataclass(frozen=True)
class ReproductionResult:
    """Result of a reproduction."""

    plan: Reproduction
    scale: TrainingScale
    lines: list[VariantSummary]
    document: dict[str, Any]
    stopped: bool = False


def reproduce(
    name: str,
    plan: Reproduction,
    place: Path,
    *,
    quick: bool,
    jobs: int = 1,
    rows: str = "",
    seeds: int | None = None,
    tell: Tell = lambda _: None,
) -> ReproductionResult:
    """Run all trainings without a result, and write table and plot of all results.

    rows: comma-separated names of the rows to train, default all; seeds: number of runs of each
    row. The table shows all results, new and old. Ctrl-C keeps those that are finished; the next
    call continues with the others.

    Raises:
        RaceError: there is no such row or seed, the settings make no training, or the folder
            cannot be written. Where a training fails, those after it are run first.
    """
    scale = plan.quick if quick else plan.full
    trainings = trainings_of(plan, scale)
    wanted = _wanted(plan, scale, trainings, rows, seeds)
    store = place / CELLS
    try:
        store.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ScenarioError(f"{store}: cannot be made: {error.strerror}") from error
    known = [read_outcome(_path(store, training), training) for training in trainings]
    outcomes = [outcome for outcome in known if outcome is not None]
    there = {(outcome["row"], outcome["seed"]) for outcome in outcomes}
    missing = [training for training in wanted if (training.row.name, training.seed) not in there]
    failed: list[str] = []
    done, stopped = len(wanted) - len(missing), False
    try:
        for training, outcome in _driven(missing, jobs, _telling(tell, done, len(wanted))):
            if isinstance(outcome, RaceError):
                failed.append(f"{_name(training)}: {outcome}")
                continue
            write_outcome(_path(store, training), outcome)
            outcomes.append(outcome)
            done += 1
            tell(ReproductionProgress(done, len(wanted), _name(training)))
    except KeyboardInterrupt:
        stopped = True
    lines = lines_of(plan, outcomes)
    document = _write(name, plan, scale, place, lines, outcomes, quick=quick)
    if failed and not stopped:
        raise ScenarioError("; ".join(failed))
    return ReproductionResult(plan, scale, lines, document, stopped)


def _wanted(
    plan: Reproduction,
    scale: TrainingScale,
    trainings: list[Training],
    rows: str,
    seeds: int | None,
) -> list[Training]:
    """Return the trainings whose results are wanted after this call."""
    if seeds is not None and seeds > scale.seeds:
        raise ScenarioError(f"--seeds {seeds}: each row has {scale.seeds}; give no more")
    names = plan.rows_named(rows) if rows else [row.name for row in plan.rows]
    most = scale.seeds if seeds is None else seeds
    return [
        training for training in trainings if training.row.name in names and training.seed <= most
    ]


def _driven(
    trainings: list[Training], jobs: int, tell: Callable[[int, Training, float], None]
) -> Iterator[tuple[Training, dict[str, Any] | RaceError]]:
    """Yield trainings with their outcomes, or why there is none, as they finish."""
    if jobs == 1:
        for number, training in enumerate(trainings):

            def on_share(share: float, number: int = number, training: Training = training) -> None:
                tell(number, training, share)

            on_share(0.0)
            yield training, _outcome(partial(run_training, training, on_share))
        return
    with worker_pool(jobs) as pool:
        waiting = {pool.submit(run_training, training): training for training in trainings}
        try:
            for future in as_completed(waiting):
                yield waiting[future], _outcome(future.result)
        except BrokenProcessPool as error:
            raise ScenarioError(
                "the process of a training died; the same command continues, fewer --jobs need "
                "less memory"
            ) from error


def _outcome(run: Callable[[], dict[str, Any]]) -> dict[str, Any] | RaceError:
    try:
        return run()
    except RaceError as error:
        return error


def _telling(tell: Tell, known: int, trainings: int) -> Callable[[int, Training, float], None]:
    return lambda number, training, share: tell(
        ReproductionProgress(known + number + share, trainings, _name(training))
    )


def _name(training: Training) -> str:
    return f"{training.row.name}, seed {training.seed}"


def _path(store: Path, training: Training) -> Path:
    plain = "".join(letter if letter.isalnum() else "-" for letter in training.row.name.lower())
    return store / f"{plain}-seed-{training.seed}.json"


def _write(
    name: str,
    plan: Reproduction,
    scale: TrainingScale,
    place: Path,
    lines: list[VariantSummary],
    outcomes: list[dict[str, Any]],
    *,
    quick: bool,
) -> dict[str, Any]:
    """Write table and plot; return the table as a document."""
    command = f"race reproduce {name}{' --quick' if quick else ''}"
    seeds = sorted({outcome["seed"] for outcome in outcomes})
    known = _versions(outcomes)
    document = {
        "name": name,
        "title": plan.title,
        "source": plan.source,
        "quick": quick,
        "command": command,
        "steps": scale.steps,
        "seeds": seeds,
        "rows": [_row(plan, line) for line in lines],
        "missing": [row.name for row in plan.rows if row.name not in _names(lines)],
        "runs": sum(line.runs for line in lines),
        "runs_wanted": plan.runs_wanted(scale),
        "remarks": remarks_on(plan, lines),
        "assumptions": list(plan.assumptions),
        "versions": known,
    }
    words = {
        "Made by": f"`{command}`",
        "Seeds": ", ".join(map(str, seeds)),
        "Versions": ", ".join(f"{package} {version}" for package, version in known.items()),
        "Picture": f"![learning, and ours beside theirs]({PLOT})",
    }
    text = page(plan, scale, lines, words, quick=quick)
    figures = json.dumps(document, indent=2) + "\n"
    write_together({place / TABLE: text.encode(), place / FIGURES: figures.encode()})
    if lines:
        draw(place / PLOT, plan, lines, scale_words(scale, lines, quick=quick))
    return document


def _versions(outcomes: list[dict[str, Any]]) -> dict[str, str]:
    """Return the versions of packages that the trainings ran with, several if they differ.

    Outcomes of earlier commits do not tell theirs.
    """
    told = [outcome["versions"] for outcome in outcomes if "versions" in outcome] or [versions()]
    packages = dict.fromkeys(package for one in told for package in one)
    return {
        package: " and ".join(dict.fromkeys(one[package] for one in told if package in one))
        for package in packages
    }


def _names(lines: list[VariantSummary]) -> set[str]:
    return {line.row.name for line in lines}


def _row(plan: Reproduction, line: VariantSummary) -> dict[str, Any]:
    shares = [column for column in plan.columns if column.of]
    return {
        "name": line.row.name,
        "changes": list(line.row.changes),
        "twist": asdict(line.row.twist),
        "imitates": list(line.row.imitates),
        "theirs": list(line.row.theirs),
        "their_number": line.row.their_number,
        "runs": line.runs,
        "steps": line.steps,
        "ours": line.means,
        "deviation": line.spreads,
        "percent": {f"{column.key} of {column.of}": line.number(column) for column in shares},
        "bounds": {f"{column.key} of {column.of}": line.bounds(column) for column in shares},
        "curve": [(at, mean) for at, mean, *_ in line.curve],
        "bands": line.bands,
    }
