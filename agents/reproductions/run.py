"""A reproduction from its cells to its folder."""

import json
import multiprocessing
import signal
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from race_agents.reproductions.cell import TrainingJob, cells_of, drive_cell, read_cell, write_cell
from race_agents.reproductions.plan import Reproduction, TrainingScale
from race_agents.reproductions.plot import draw
from race_agents.reproductions.summary import VariantSummary, lines_of, remarks_on
from race_agents.reproductions.table import page, scale_words
from race_agents.training.folder import versions
from race_server.errors import ScenarioError

CELLS, TABLE, FIGURES, PLOT = "cells", "README.md", "table.json", "plot.png"


@dataclass(frozen=True)
class ReproductionProgress:
    """How far a reproduction is."""

    done: float  # cells, the share of the one under way included
    cells: int
    name: str  # of the cell


Tell = Callable[[ReproductionProgress], None]


@dataclass(frozen=True)
class ReproductionResult:
    """What came of a reproduction."""

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
    """Drive all cells that are not known yet, and write table and plot of all that are.

    rows: comma-separated names of those that are driven now, all without; seeds: so many of each
    row. The table shows all that is known, whatever is driven. Ctrl-C leaves those that are done;
    the next call goes on with the others.

    Raises:
        RaceError: there is no such row or seed, the settings make no training, or the folder
            cannot be written.
    """
    scale = plan.quick if quick else plan.full
    cells = cells_of(plan, scale)
    wanted = _wanted(plan, scale, cells, rows, seeds)
    store = place / CELLS
    try:
        store.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ScenarioError(f"{store}: cannot be made: {error.strerror}") from error
    known = [read_cell(_path(store, cell), cell) for cell in cells]
    outcomes = [outcome for outcome in known if outcome is not None]
    there = {(outcome["row"], outcome["seed"]) for outcome in outcomes}
    missing = [cell for cell in wanted if (cell.row.name, cell.seed) not in there]
    done, stopped = len(wanted) - len(missing), False
    try:
        for cell, outcome in _driven(missing, jobs, _telling(tell, done, len(wanted))):
            write_cell(_path(store, cell), outcome)
            outcomes.append(outcome)
            done += 1
            tell(ReproductionProgress(done, len(wanted), _name(cell)))
    except KeyboardInterrupt:
        stopped = True
    lines = lines_of(plan, outcomes)
    document = _write(name, plan, scale, place, lines, quick=quick)
    return ReproductionResult(plan, scale, lines, document, stopped)


def _wanted(
    plan: Reproduction, scale: TrainingScale, cells: list[TrainingJob], rows: str, seeds: int | None
) -> list[TrainingJob]:
    """Return the cells that are to be there after this call."""
    if seeds is not None and seeds > scale.seeds:
        raise ScenarioError(f"--seeds {seeds}: each row has {scale.seeds}; give no more")
    names = plan.rows_named(rows) if rows else [row.name for row in plan.rows]
    most = scale.seeds if seeds is None else seeds
    return [cell for cell in cells if cell.row.name in names and cell.seed <= most]


def _driven(
    cells: list[TrainingJob], jobs: int, tell: Callable[[int, TrainingJob, float], None]
) -> Iterator[tuple[TrainingJob, dict[str, Any]]]:
    """Yield cells with their outcomes as they are done."""
    if jobs == 1:
        for number, cell in enumerate(cells):

            def on_share(share: float, number: int = number, cell: TrainingJob = cell) -> None:
                tell(number, cell, share)

            on_share(0.0)
            yield cell, drive_cell(cell, on_share)
        return
    # PyTorch's threads do not survive a fork.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, mp_context=context, initializer=_begin_worker) as pool:
        waiting = {pool.submit(drive_cell, cell): cell for cell in cells}
        try:
            for future in as_completed(waiting):
                yield waiting[future], future.result()
        except BrokenProcessPool as error:
            raise ScenarioError(
                "the process of a training died; the same command goes on, fewer --jobs need "
                "less memory"
            ) from error
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _begin_worker() -> None:
    """Let Ctrl-C end this process without a word: the one that started it speaks."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    warnings.filterwarnings("ignore", module="stable_baselines3")


def _telling(tell: Tell, known: int, cells: int) -> Callable[[int, TrainingJob, float], None]:
    return lambda number, cell, share: tell(
        ReproductionProgress(known + number + share, cells, _name(cell))
    )


def _name(cell: TrainingJob) -> str:
    return f"{cell.row.name}, seed {cell.seed}"


def _path(store: Path, cell: TrainingJob) -> Path:
    plain = "".join(letter if letter.isalnum() else "-" for letter in cell.row.name.lower())
    return store / f"{plain}-seed-{cell.seed}.json"


def _write(
    name: str,
    plan: Reproduction,
    scale: TrainingScale,
    place: Path,
    lines: list[VariantSummary],
    *,
    quick: bool,
) -> dict[str, Any]:
    """Write table and plot; return the table as a document."""
    command = f"race reproduce {name}{' --quick' if quick else ''}"
    known = versions()
    document = {
        "name": name,
        "title": plan.title,
        "source": plan.source,
        "quick": quick,
        "command": command,
        "steps": scale.steps,
        "seeds": list(range(1, scale.seeds + 1)),
        "rows": [_row(line) for line in lines],
        "missing": [row.name for row in plan.rows if row.name not in _names(lines)],
        "runs": sum(line.runs for line in lines),
        "runs_wanted": scale.seeds * len(plan.rows),
        "remarks": remarks_on(plan, lines),
        "assumptions": list(plan.assumptions),
        "versions": known,
    }
    words = {
        "Made by": f"`{command}`",
        "Seeds": ", ".join(str(seed) for seed in range(1, scale.seeds + 1)),
        "Versions": ", ".join(f"{package} {version}" for package, version in known.items()),
        "Picture": f"![learning, and ours beside theirs]({PLOT})",
    }
    text = page(plan, scale, lines, words, quick=quick)
    (place / TABLE).write_text(text, encoding="utf-8")
    (place / FIGURES).write_text(json.dumps(document, indent=2) + "\n", encoding="utf-8")
    if lines:
        draw(place / PLOT, plan, lines, scale_words(scale, lines, quick=quick))
    return document


def _names(lines: list[VariantSummary]) -> set[str]:
    return {line.row.name for line in lines}


def _row(line: VariantSummary) -> dict[str, Any]:
    return {
        "name": line.row.name,
        "changes": list(line.row.changes),
        "twist": asdict(line.row.twist),
        "theirs": list(line.row.theirs),
        "their_number": line.row.their_number,
        "runs": line.runs,
        "steps": line.steps,
        "ours": line.means,
        "deviation": line.spreads,
        "curve": line.curve,
    }
