"""How often a vehicle with a trailer docks along its own plans, under one trouble after another."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, dataclass

import numpy as np

from race_agents.planning.dock_drive import TROUBLES, Drive, Trouble, Yard
from race_agents.planning.plan_bench import TowedYard, chosen_tasks, is_hopeless
from race_server.competition.proportion import wilson_interval
from race_server.core.vehicles import Vehicle

DOCKED = "docked"  # how a drive ends that went well


@dataclass(frozen=True)
class DriveRow:
    """The drives into one dock under one trouble, counted."""

    task: str
    trouble: str
    runs: int
    docked: int
    share: float  # docked, of all runs
    share_low: float  # bounds of its 95 % interval
    share_high: float
    endings: dict[str, int]  # how often each way to end came
    time_s_median: float | None  # of docked runs
    plans_mean: float | None
    offset_m_p95: float | None  # of the trailer's axle from its place
    turn_rad_p95: float | None


@dataclass(frozen=True)
class Driven:
    """All rows."""

    vehicle: str
    seed: int
    rows: list[DriveRow]

    def document(self) -> dict[str, object]:
        """Return the rows as one document."""
        rows = [asdict(row) for row in self.rows]
        return {"vehicle": self.vehicle, "seed": self.seed, "rows": rows}


def bench_drive(
    vehicle: Vehicle,
    *,
    runs: int,
    seed: int,
    text: str = "",
    troubles: Sequence[Trouble] = TROUBLES,
) -> Driven:
    """Return the figures of `race bench plan --drive`: the same starts under each trouble.

    Raises:
        ScenarioError: no task has the text in its name.
        PlanError: the vehicle does not draw just one trailer.
    """
    yard, rows = TowedYard(vehicle), []
    for number, task in chosen_tasks(yard.tasks, text):
        starts = list(yard.starts(task, runs, np.random.default_rng((seed, number))))
        for trouble in troubles:
            drives: list[Drive] = []
            for run, start in enumerate(starts):
                if is_hopeless(sum(drive.ending == DOCKED for drive in drives), len(drives)):
                    break
                yard_now = Yard(vehicle, task, start, trouble)
                drives.append(yard_now.drive(np.random.default_rng((seed, run))))
            rows.append(_row(task.name, trouble.name, drives))
    return Driven(vehicle.name, seed, rows)


def _row(task: str, trouble: str, drives: Sequence[Drive]) -> DriveRow:
    docked = [drive for drive in drives if drive.ending == DOCKED]
    low, high = wilson_interval(len(docked), len(drives))
    times = [drive.time_s for drive in docked]
    offsets = [float(np.hypot(drive.along, drive.across)) for drive in docked]
    turns = [abs(drive.turn) for drive in docked]
    return DriveRow(
        task=task,
        trouble=trouble,
        runs=len(drives),
        docked=len(docked),
        share=len(docked) / len(drives),
        share_low=round(low, 4),
        share_high=round(high, 4),
        endings=dict(Counter(drive.ending for drive in drives)),
        time_s_median=round(float(np.median(times)), 1) if docked else None,
        plans_mean=round(sum(drive.plans for drive in docked) / len(docked), 2) if docked else None,
        offset_m_p95=round(float(np.percentile(offsets, 95)), 3) if docked else None,
        turn_rad_p95=round(float(np.percentile(turns, 95)), 4) if docked else None,
    )
