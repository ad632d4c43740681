"""How often and how fast the planner finds a way into slots of many sizes."""

import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import numpy as np

from race_agents.planning.parking_tasks import ParkingTask, tasks
from race_agents.planning.path import Path
from race_agents.planning.path_planner import PathPlanner
from race_server.competition.proportion import wilson_interval
from race_server.core.kernels.geometry import Pose
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError, ScenarioError


@dataclass(frozen=True)
class Row:
    """The runs of one task, counted."""

    task: str
    runs: int
    solved: int
    share: float  # solved, of all runs
    share_low: float  # bounds of its 95 % interval
    share_high: float
    cpu_ms_median: float  # of a plan, found or not
    cpu_ms_p95: float
    cpu_ms_most: float
    changes_mean: float | None  # changes of direction, of solved runs
    length_mean_m: float | None
    failures: dict[str, int]  # how often each error was reported


@dataclass(frozen=True)
class Measured:
    """All rows, and a path of each task to look at."""

    vehicle: str
    seed: int
    first_plan_s: float  # wall time of the first plan, which may compile
    rows: list[Row]
    shown: list[tuple[ParkingTask, Path]]

    def document(self) -> dict[str, object]:
        """Return the rows as one document."""
        return {
            "vehicle": self.vehicle,
            "seed": self.seed,
            "first_plan_s": self.first_plan_s,
            "rows": [asdict(row) for row in self.rows],
        }


def starts_of(
    task: ParkingTask, planner: PathPlanner, runs: int, random: np.random.Generator
) -> Iterator[Pose]:
    """Yield random starts that touch nothing; runs: how many."""
    walls = task.walls()
    while runs > 0:
        start = task.start(planner.vehicle, random)
        if planner.is_free(start, walls):
            runs -= 1
            yield start


def bench_plan(vehicle: Vehicle, *, runs: int, seed: int, text: str = "") -> Measured:
    """Return the figures of `race bench plan`, for tasks with a text in their names.

    Raises:
        ScenarioError: no task has it.
    """
    every = tasks(vehicle)
    chosen = [(number, task) for number, task in enumerate(every) if text in task.name]
    if not chosen:
        names = "; ".join(task.name for task in every)
        raise ScenarioError(f"--task {text!r} is in the name of no task; these are: {names}")
    begun = time.monotonic()
    planner = PathPlanner(vehicle)
    first = every[0]
    start = next(starts_of(first, planner, 1, np.random.default_rng(seed)))
    planner.plan(start, first.goal(vehicle), first.walls())
    first_plan_s = round(time.monotonic() - begun, 2)
    rows, shown = [], []
    # A task has the same starts, whichever others are measured.
    for number, task in chosen:
        row, path = _measure(task, planner, runs, np.random.default_rng((seed, number)))
        rows.append(row)
        shown += [(task, path)] if path else []
    return Measured(vehicle.name, seed, first_plan_s, rows, shown)


def _measure(
    task: ParkingTask, planner: PathPlanner, runs: int, random: np.random.Generator
) -> tuple[Row, Path | None]:
    """Return the row of a task, and the path of its last solved run."""
    walls, goal = task.walls(), task.goal(planner.vehicle)
    times, paths, failures = [], [], Counter[str]()
    for start in starts_of(task, planner, runs, random):
        begun = time.process_time()
        try:
            paths.append(planner.plan(start, goal, walls))
        except PlanError as error:
            failures[str(error)] += 1
        times.append(1e3 * (time.process_time() - begun))
    low, high = wilson_interval(len(paths), runs)
    row = Row(
        task=task.name,
        runs=runs,
        solved=len(paths),
        share=len(paths) / runs,
        share_low=round(low, 4),
        share_high=round(high, 4),
        cpu_ms_median=round(float(np.median(times)), 2),
        cpu_ms_p95=round(float(np.percentile(times, 95)), 2),
        cpu_ms_most=round(max(times), 2),
        changes_mean=round(sum(path.changes for path in paths) / len(paths), 2) if paths else None,
        length_mean_m=round(sum(path.length for path in paths) / len(paths), 2) if paths else None,
        failures=dict(failures),
    )
    return row, paths[-1] if paths else None
