"""How often and how fast the planner finds a way into slots of many sizes."""

import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from race_agents.planning.dock_tasks import DockTask, docks
from race_agents.planning.parking_tasks import ParkingTask, tasks
from race_agents.planning.path import Path
from race_agents.planning.path_planner import PathPlanner
from race_agents.planning.towed_planner import TowedPlanner
from race_server.competition.proportion import wilson_interval
from race_server.core.kernels.geometry import Pose
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError, ScenarioError

# A task of which none of the first runs was solved has no more: another 1,000 searches that all end
# at their bounds would take an hour and move an interval that begins at 0 % from 7 to 0.4 %.
HOPELESS = 50


@dataclass(frozen=True)
class Row:
    """The runs of one task, counted."""

    task: str
    runs: int  # as many as asked for, or `HOPELESS` of which none was solved
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
    shown: list[tuple[ParkingTask | DockTask, Path]]

    def document(self) -> dict[str, object]:
        """Return the rows as one document."""
        return {
            "vehicle": self.vehicle,
            "seed": self.seed,
            "first_plan_s": self.first_plan_s,
            "rows": [asdict(row) for row in self.rows],
        }


class CarYard:
    """Tasks of a vehicle without a trailer, and its planner."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Make room for plans."""
        self.vehicle, self.tasks = vehicle, tasks(vehicle)
        self._planner = PathPlanner(vehicle)

    def starts(
        self, task: ParkingTask, runs: int, random: np.random.Generator
    ) -> Iterator[tuple[Pose]]:
        """Yield random starts that touch nothing; runs: how many."""
        walls = task.walls()
        while runs > 0:
            start = task.start(self.vehicle, random)
            if self._planner.is_free(start, walls):
                runs -= 1
                yield (start,)

    def plan(self, task: ParkingTask, pose: Pose) -> Path:
        """Return a path from a start.

        Raises:
            PlanError: none was found.
        """
        return self._planner.plan(pose, task.goal(self.vehicle), task.walls())


class TowedYard:
    """Tasks of a vehicle with a trailer, and its planner."""

    def __init__(self, vehicle: Vehicle) -> None:
        """Make room for plans.

        Raises:
            PlanError: the vehicle draws several trailers.
        """
        self._planner = TowedPlanner(vehicle)
        self.vehicle, self.tasks = vehicle, docks(vehicle)

    def starts(
        self, task: DockTask, runs: int, random: np.random.Generator
    ) -> Iterator[tuple[Pose, float]]:
        """Yield random starts that touch nothing; runs: how many."""
        walls, boxes = task.walls(), task.boxes()
        while runs > 0:
            pose, angle = task.start(self.vehicle, random)
            if self._planner.is_free(pose, angle, walls, boxes):
                runs -= 1
                yield pose, angle

    def plan(self, task: DockTask, pose: Pose, angle: float) -> Path:
        """Return a path from a start.

        Raises:
            PlanError: none was found.
        """
        walls, boxes = task.walls(), task.boxes()
        return self._planner.plan(pose, angle, task.goal(self.vehicle), walls, boxes)


def bench_plan(vehicle: Vehicle, *, runs: int, seed: int, text: str = "") -> Measured:
    """Return the figures of `race bench plan`, for tasks with a text in their names.

    Raises:
        ScenarioError: no task has it.
        PlanError: the vehicle draws several trailers.
    """
    begun = time.monotonic()
    yard: Any = TowedYard(vehicle) if vehicle.trailers else CarYard(vehicle)
    chosen = chosen_tasks(yard.tasks, text)
    _, task = chosen[0]
    first = next(yard.starts(task, 1, np.random.default_rng(seed)))
    with suppress(PlanError):
        yard.plan(task, *first)
    first_plan_s = round(time.monotonic() - begun, 2)
    rows, shown = [], []
    # A task has the same starts, whichever others are measured.
    for number, task in chosen:
        row, path = _measure(task, yard, runs, np.random.default_rng((seed, number)))
        rows.append(row)
        shown += [(task, path)] if path else []
    return Measured(vehicle.name, seed, first_plan_s, rows, shown)


def chosen_tasks(every: Sequence[Any], text: str) -> list[tuple[int, Any]]:
    """Return the tasks with a text in their names, and their numbers.

    Raises:
        ScenarioError: no task has it.
    """
    chosen = [(number, task) for number, task in enumerate(every) if text in task.name]
    if not chosen:
        names = "; ".join(task.name for task in every)
        raise ScenarioError(f"--task {text!r} is in the name of no task; these are: {names}")
    return chosen


def is_hopeless(solved: int, made: int) -> bool:
    """Return whether no more runs of a task are made. made: runs so far."""
    return solved == 0 and made >= HOPELESS


def _measure(
    task: ParkingTask | DockTask, yard: Any, runs: int, random: np.random.Generator
) -> tuple[Row, Path | None]:
    """Return the row of a task, and the path of its last solved run."""
    times: list[float] = []
    paths: list[Path] = []
    failures = Counter[str]()
    for start in yard.starts(task, runs, random):
        if is_hopeless(len(paths), len(times)):
            break
        begun = time.process_time()
        try:
            paths.append(yard.plan(task, *start))
        except PlanError as error:
            failures[str(error)] += 1
        times.append(1e3 * (time.process_time() - begun))
    made = len(times)
    low, high = wilson_interval(len(paths), made)
    row = Row(
        task=task.name,
        runs=made,
        solved=len(paths),
        share=len(paths) / made,
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
