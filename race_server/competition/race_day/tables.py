"""The tables of a race day as texts, for terminal and picture."""

from dataclasses import dataclass
from functools import partial

from race_server.competition.race_day.formats import LAP, Races, TimeTrial
from race_server.competition.race_day.ledger import Heat, Ledger, RacesResult, TrialResult
from race_server.competition.race_day.plan import DayPlan
from race_server.competition.race_day.record import TeamResult
from race_server.core.clock import lap_text

NONE = "–"
NOT_CLASSIFIED = "n. c."
STEWARDS = "stewards"  # who decided without a protest of a team
# With more races for each team a stage is shown as one table with a column for each of them.
MOST_APART = 2


@dataclass(frozen=True)
class DayTable:
    """One table: a title, columns and rows of texts."""

    title: str
    columns: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    words: frozenset[str] = frozenset({"team", "driver", "remarks"})  # columns set left
    labels: tuple[str, ...] = ()  # of the columns, in the language of the sheet

    @property
    def heads(self) -> tuple[str, ...]:
        """What stands above the columns."""
        return self.labels or self.columns


def tables_of(plan: DayPlan, ledger: Ledger) -> list[DayTable]:
    """Return all tables in order: each stage, then the final classification."""
    tables = []
    for stage in ledger.stages:
        if isinstance(stage, TrialResult):
            tables.append(trial_table(stage))
        elif stage.stage.rounds * len(stage.stage.tracks) > MOST_APART:
            tables.append(_points_table(ledger, stage))
        else:
            tables += [
                heat_table(heat, has_points=bool(stage.stage.points)) for heat in stage.heats
            ]
    if ledger.protests:
        tables.append(_protest_table(ledger))
    return [*tables, final_table(ledger)]


def _protest_table(ledger: Ledger) -> DayTable:
    """Return all protests with what was decided."""
    rows = tuple(
        (str(one.number), one.title, one.by or STEWARDS, one.against, one.why, one.outcome)
        for one in ledger.protests
    )
    columns = ("", "about", "by", "against", "why", "decision")
    return DayTable("Protests", columns, rows, frozenset(columns[1:]))


def trial_table(trial: TrialResult) -> DayTable:
    """Return a time trial: attempts, the time that counts, and what went wrong."""
    stage = trial.stage
    attempts = [f"attempt {n}" for n in range(1, stage.attempts + 1)]
    has_points = stage.best_points > 0
    columns = ["", "team", *attempts, "counts", "touches"]
    columns += [*(["points"] if has_points else []), "remarks"]
    rows = []
    for place, row in enumerate(trial.rows, start=1):
        times = [
            lap_text(time) if _counts(stage, time, drive) else "failed"
            for time, drive in zip(row.times_us, row.attempts, strict=True)
        ]
        times += [NONE] * (stage.attempts - len(times))
        points = [str(row.points)] if has_points else []
        touches = "/".join(str(drive.wall_contacts) for drive in row.attempts)
        remarks = " / ".join(
            dict.fromkeys(filter(None, map(partial(_remark, stage), row.attempts)))
        )
        best = lap_text(row.time_us) if row.attempts and _is_shown(stage, row.time_us) else NONE
        rows.append((str(place), row.team, *times, best, touches, *points, remarks))
    boxes = len(trial.course.obstacles)
    laps = f"{stage.laps} lap" + ("s" if stage.laps > 1 else "")
    where = f"{trial.course.title}, {laps}, " + (f"{boxes} obstacles" if boxes else "empty")
    return DayTable(f"{stage.name} · {where}", tuple(columns), tuple(rows))


def _is_shown(stage: TimeTrial, time_us: int) -> bool:
    """Return whether the time of a failure is shown as such: where laps count it is none."""
    return stage.counts != LAP or time_us < round(stage.failure_s * 1e6)


def _counts(stage: TimeTrial, time_us: int, drive: TeamResult) -> bool:
    return _is_shown(stage, time_us) if stage.counts == LAP else drive.place > 0


def _remark(stage: TimeTrial, drive: TeamResult) -> str:
    """Return the remark on an attempt; where laps count, with those that do not."""
    gone = [f"lap {lap.number} {lap.why}" for lap in drive.deleted if stage.counts == LAP]
    return "; ".join(filter(None, [drive.remark, *gone]))


def heat_table(heat: Heat, *, has_points: bool) -> DayTable:
    """Return one race: places, times, contacts and remarks."""
    columns = ["", "team", "grid", "laps", "time", "best lap", "touches", "warnings"]
    rows = []
    for drive in heat.record.drives:
        points = [str(heat.points[drive.team])] if has_points else []
        figures = (
            str(heat.grid.index(drive.team) + 1),
            str(drive.laps),
            lap_text(drive.time_us),
            lap_text(drive.best_lap_us),
            str(drive.wall_contacts + drive.kart_contacts),
            str(drive.warnings) if drive.warnings else NONE,
        )
        rows.append((_place(drive.place), drive.team, *figures, *points, drive.remark))
    columns += [*(["points"] if has_points else []), "remarks"]
    return DayTable(f"{heat.label.title} · {heat.course.title}", tuple(columns), tuple(rows))


def _points_table(ledger: Ledger, stage: RacesResult) -> DayTable:
    """Return a stage of many races: place and points of each team in each race.

    In the order of the standings as if only this stage counted; those decide between equals.
    """
    columns = [f"{heat.label.turn}{heat.letter}" for heat in stage.heats]
    columns = list(dict.fromkeys(columns))
    cells: dict[str, dict[str, str]] = {}
    total: dict[str, int] = {}
    outs: dict[str, int] = {}
    for heat in stage.heats:
        column = f"{heat.label.turn}{heat.letter}"
        for drive in heat.record.drives:
            points = heat.points[drive.team]
            total[drive.team] = total.get(drive.team, 0) + points
            outs[drive.team] = outs.get(drive.team, 0) + (drive.place == 0)
            text = f"{drive.place} ({points})" if drive.place else "out"
            cells.setdefault(drive.team, {})[column] = text
    alone = Ledger(ledger.format, tuple(ledger.order()), [stage])
    order = [team.name for team in alone.order() if team.name in total]
    rows = tuple(
        (
            str(place),
            name,
            *(cells[name].get(column, NONE) for column in columns),
            str(total[name]),
            _last_remark(stage, name),
        )
        for place, name in enumerate(order, start=1)
    )
    title = f"{stage.stage.name} · {stage.stage.laps} laps each, place (points) by round and track"
    return DayTable(title, ("", "team", *columns, "points", "remarks"), rows)


def _last_remark(stage: RacesResult, team: str) -> str:
    said = [
        f"{heat.label.turn}{heat.letter}: {drive.remark}"
        for heat in stage.heats
        for drive in heat.record.drives
        if drive.team == team and drive.remark
    ]
    more = f" (+{len(said) - 1})" if len(said) > 1 else ""
    return said[0] + more if said else ""


def final_table(ledger: Ledger) -> DayTable:
    """Return the final classification."""
    has_points = ledger.format.has_points
    decides = "points" if has_points else "qualifying"
    if not ledger.heats():
        decides = "points" if has_points else "time"
    rows = []
    for row in ledger.classification():
        figure = str(row.points) if has_points else lap_text(row.qualifying_us)
        best = [
            d.best_lap_us for h in ledger.heats() for d in h.record.drives if d.team == row.team
        ]
        laps = [time for time in best if time > 0]
        rows.append(
            (_place(row.place), row.team, row.driver, figure, lap_text(min(laps, default=0)))
        )
    return DayTable(
        "Final classification", ("", "team", "driver", decides, "best race lap"), tuple(rows)
    )


def _place(place: int) -> str:
    return str(place) if place > 0 else NOT_CLASSIFIED


def heading(plan: DayPlan) -> str:
    """Return the title of an event."""
    is_day = any(isinstance(stage, Races) for stage in plan.format.stages)
    return f"{plan.format.title} race day" if is_day else plan.format.title


def subtitle(plan: DayPlan) -> str:
    """Return what, where and with which seed, in one line."""
    tracks = ", ".join(f"{letter} {course.name}" for letter, course in plan.courses.items())
    teams = f"{len(plan.teams)} team" + ("s" if len(plan.teams) != 1 else "")
    return f"{teams} · {plan.vehicle.name} · tracks {tracks} · seed {plan.seed}"
