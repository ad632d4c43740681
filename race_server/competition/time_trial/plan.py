"""A whole trial: all input is checked first, then the runs are driven."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from race_server.competition.pool import Report, Work, is_ready, run_all
from race_server.competition.time_trial.draw import Drawn, draw_trial
from race_server.competition.time_trial.figures import Loss, TrialSummary, losses_of, rows_of
from race_server.competition.time_trial.gaps import DECISION_S, Gap
from race_server.competition.time_trial.ghost import Ghost, ghost_of, sector_deltas
from race_server.competition.time_trial.lap import TrialLap
from race_server.competition.time_trial.limits import LapLimits, limits_of, trace_of_line
from race_server.competition.time_trial.run import Run, drive_run, lost_run
from race_server.competition.time_trial.run_spec import RunSpec, task_of
from race_server.competition.time_trial.save import RunLog
from race_server.competition.time_trial.table import lap_rows
from race_server.core.state import Floats
from race_server.core.vehicle_presets import vehicle_named
from race_server.envs.batch import Batch
from race_server.scenario.track.check import require_passable
from race_server.scenario.track.load import load_course

Place = tuple[str, str]  # track and vehicle
RUNS = Work(drive_run, lost_run)


@dataclass(frozen=True)
class TrialPlan:
    """The runs of a trial, and what they are compared with."""

    specs: tuple[RunSpec, ...]
    gaps: tuple[Gap, ...]
    jobs: int = 0
    ghost: str = ""
    results: Path | None = None

    @property
    def places(self) -> list[Place]:
        """Each track with each vehicle, once."""
        return list(dict.fromkeys((spec.track, spec.vehicle) for spec in self.specs))


@dataclass
class Trial:
    """A trial and its results so far."""

    plan: TrialPlan
    limits: LapLimits
    ghosts: dict[Place, Ghost]
    runs: dict[int, Run] = field(default_factory=dict)  # by number of the run
    stopped: bool = False

    @property
    def done(self) -> list[Run]:
        """The finished runs, in the order of the plan."""
        return [self.runs[number] for number in sorted(self.runs)]

    @property
    def rows(self) -> list[TrialSummary]:
        """The figures of each driver."""
        return rows_of(self.done, self.limits.times)

    @property
    def losses(self) -> list[Loss]:
        """What the reality gaps cost."""
        return losses_of(self.rows)

    @property
    def failed(self) -> bool:
        """Whether a driver raised or stalled."""
        return any(run.failed for run in self.runs.values())

    def drive(self, log: RunLog, report: Report) -> None:
        """Drive the runs and save each as it finishes; Ctrl-C stops the trial."""
        outcomes = run_all(RUNS, self.plan.specs, self.plan.jobs, report)
        try:
            for number, run in outcomes:
                self.runs[number] = run
                log.add(run)
        except KeyboardInterrupt:
            self.stopped = True
        finally:
            outcomes.close()

    def best_laps(self, place: Place, gap: Gap) -> list[tuple[str, TrialLap, list[Floats]]]:
        """Return name, best lap and the other laps' traces of each driver who completed one."""
        laps: dict[str, list[TrialLap]] = {}
        for run in self.done:
            if (run.spec.track, run.spec.vehicle) == place and run.spec.gap == gap:
                laps.setdefault(run.spec.driver, []).extend(run.laps)
        found = []
        for driver, driven in laps.items():
            # A lap from standstill is shown if there is no other.
            shown = [lap for lap in driven if lap.is_flying] or driven
            if shown:
                best = min(shown, key=lambda lap: lap.time_us)
                found.append((driver, best, [lap.trace for lap in shown if lap is not best]))
        return found

    def reference(self, place: Place) -> tuple[str, Floats] | None:
        """Return the reference for laps at a place: the ghost, else the limit."""
        if ghost := self.ghosts.get(place):
            return f"ghost {ghost.name}", ghost.trace
        if line := self.limits.lines.get(place):
            trace = trace_of_line(line, load_course(place[0]).length)
            return f"limit {line.time_s:.3f} s", trace
        return None

    def against_ghost(self, place: Place) -> list[tuple[str, float, tuple[float, ...]]]:
        """Return the loss [s] of each driver's best lap on the ghost, in all and by sector."""
        ghost, course = self.ghosts[place], load_course(place[0])
        return [
            (
                driver if len(self.plan.gaps) == 1 else f"{driver}, {gap.name}",
                lap.time_s - ghost.time_s,
                sector_deltas(lap.trace, ghost.trace, course),
            )
            for gap in self.plan.gaps
            for driver, lap, _ in self.best_laps(place, gap)
        ]

    def draw(self, path: Path) -> list[Path]:
        """Draw a picture for each track, vehicle and gap with laps; return the files."""
        return [
            self._draw_one(path, place, gap, laps)
            for place in self.plan.places
            for gap in self.plan.gaps
            if (laps := self.best_laps(place, gap))
        ]

    def _draw_one(
        self, path: Path, place: Place, gap: Gap, laps: list[tuple[str, TrialLap, list[Floats]]]
    ) -> Path:
        course, vehicle = load_course(place[0]), place[1]
        title = f"{course.title}, {vehicle}"
        parts = [path.stem]
        if len(self.plan.places) > 1:
            parts += [course.name, vehicle]
        if len(self.plan.gaps) > 1:
            parts.append(gap.name)
            title += f", gap: {gap.name}"
        to = path.with_name("-".join(parts) + path.suffix)
        drawn = [Drawn(name, lap.time_s, lap.trace, tuple(others)) for name, lap, others in laps]
        draw_trial(course, title, drawn, self.reference(place), to)
        return to

    def as_json(self) -> dict[str, Any]:
        """Return everything as one document."""
        first = self.plan.specs[0]
        return {
            "start": first.start,
            "laps_wanted": first.laps,
            "decision_s": DECISION_S,
            "gaps": {gap.name: gap.words() for gap in self.plan.gaps},
            "rows": [row.as_json() for row in self.rows],
            "losses": [loss.as_json() for loss in self.losses],
            "runs": [_run_row(run) for run in self.done],
            "laps": [self._with_ghost(run, row) for run, row in self._lap_rows()],
            "ghosts": [self._ghost_row(place, ghost) for place, ghost in self.ghosts.items()],
            "stopped": self.stopped,
        }

    def _lap_rows(self) -> list[tuple[Run, dict[str, Any]]]:
        return [(run, row) for run in self.done for row in lap_rows([run])]

    def _with_ghost(self, run: Run, row: dict[str, Any]) -> dict[str, Any]:
        ghost = self.ghosts.get((run.spec.track, run.spec.vehicle))
        if ghost is None:
            return row
        return {**row, "behind_ghost_s": round(row["lap_s"] - ghost.time_s, 6)}

    def _ghost_row(self, place: Place, ghost: Ghost) -> dict[str, Any]:
        rows = [
            {"driver": label, "lap_s": round(lap, 4), "sectors_s": [round(s, 4) for s in parts]}
            for label, lap, parts in self.against_ghost(place)
        ]
        track, vehicle = place
        return {
            "track": track,
            "vehicle": vehicle,
            "ghost": ghost.name,
            "time_s": ghost.time_s,
            "behind": rows,
        }


def _run_row(run: Run) -> dict[str, Any]:
    return {
        "driver": run.spec.driver,
        "track": run.spec.track,
        "vehicle": run.spec.vehicle,
        "gap": run.spec.gap.name,
        "seed": run.spec.seed,
        "laps": len(run.laps),
        "crashes": run.crashes,
        "rescues": run.rescues,
        "draws": {name: round(value, 4) for name, value in run.draws.items()},
        "failed": run.failed,
        "remark": run.remark,
        "digest": run.digest,
    }


def prepare(plan: TrialPlan) -> Trial:
    """Return the trial ready to be driven, with limits and ghosts.

    Raises:
        RaceError: a track or vehicle does not exist or does not fit, or there is no such ghost.
    """
    for track, vehicle in plan.places:
        require_passable(load_course(track), vehicle_named(vehicle))
    ghosts = {}
    if plan.ghost:
        for track, vehicle in plan.places:
            course = load_course(track)
            ghosts[track, vehicle] = ghost_of(plan.ghost, course, vehicle, plan.results)
    return Trial(plan, limits_of(plan.places), ghosts)


def compile_once(spec: RunSpec) -> None:
    """Compile the training world, so that not every process compiles it at the same time."""
    if not is_ready():
        batch = Batch(task_of(spec, load_course(spec.track), "full"))
        batch.step()
