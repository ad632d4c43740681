"""A race day as plain data: the document that `--json` prints."""

from dataclasses import asdict
from typing import Any

from race_server.competition.event_state import EventState
from race_server.competition.race_day.day import Day
from race_server.competition.race_day.ledger import FinalRow, Heat, Ledger, TrialResult
from race_server.competition.race_day.plan import DayPlan
from race_server.competition.race_day.record import TeamResult
from race_server.core.clock import seconds_of
from race_server.scenario.track.course import Course


def day_document(plan: DayPlan, ledger: Ledger) -> dict[str, Any]:
    """Return all tables of a day and every lap; times in seconds, null without one."""
    stages: list[dict[str, Any]] = []
    for stage in ledger.stages:
        if isinstance(stage, TrialResult):
            stages.append(_trial(stage))
        else:
            stages.append({"name": stage.stage.name, "races": [_heat(h) for h in stage.heats]})
    rows = ledger.classification()
    protests = [asdict(protest) for protest in ledger.protests]
    return {
        "format": plan.format.name,
        "title": plan.format.title,
        "seed": plan.seed,
        "vehicle": plan.vehicle.name,
        "tracks": {letter: course.name for letter, course in plan.courses.items()},
        "teams": [{"team": team.name, "driver": team.driver} for team in plan.teams],
        "stages": stages,
        "classification": [_final(row) for row in rows],
        "podium": [row.team for row in rows if 1 <= row.place <= 3],
        **({"protests": protests} if protests else {}),
    }


def event_document(day: Day, state: EventState) -> dict[str, Any]:
    """Return an event on the network so far: its tables as those of a day, and what comes next."""
    numbers = {one.team: one.number for one in state.entrants if one.number}
    return {
        "event": state.name,
        "begun_at": state.begun_at,
        "is_final": state.is_final,
        "driven": len(day.records),
        "next": day.next.title if day.next else None,
        "numbers": numbers,
        **day_document(day.plan, day.ledger),
    }


def _trial(trial: TrialResult) -> dict[str, Any]:
    rows = [
        {
            "team": row.team,
            "time_s": seconds_of(row.time_us),
            "attempts_s": [seconds_of(time) for time in row.times_us],
            "points": row.points,
            "drives": [_drive(drive) for drive in row.attempts],
        }
        for row in trial.rows
    ]
    return {
        "name": trial.stage.name,
        **_course(trial.course),
        "laps": trial.stage.laps,
        "rows": rows,
    }


def _heat(heat: Heat) -> dict[str, Any]:
    return {
        "title": heat.label.title,
        **_course(heat.course),
        "grid": list(heat.grid),
        "digest": heat.record.digest,
        "rows": [{**_drive(d), "points": heat.points[d.team]} for d in heat.record.drives],
    }


def _course(course: Course) -> dict[str, Any]:
    return {
        "track": course.name,
        "obstacles": [
            {"x": round(box.x, 3), "y": round(box.y, 3), "heading": round(box.heading, 3)}
            for box in course.obstacles
        ],
    }


def _drive(drive: TeamResult) -> dict[str, Any]:
    return {
        "team": drive.team,
        "place": drive.place or None,
        "laps": drive.laps,
        "time_s": _seconds(drive.time_us),
        "best_lap_s": _seconds(drive.best_lap_us),
        "lap_times_s": [seconds_of(time) for time in drive.lap_times_us],
        "penalty_s": seconds_of(drive.penalty_us),
        "wall_contacts": drive.wall_contacts,
        "kart_contacts": drive.kart_contacts,
        "warnings": drive.warnings,
        "remark": drive.remark,
    }


def _final(row: FinalRow) -> dict[str, Any]:
    return {
        "place": row.place or None,
        "team": row.team,
        "driver": row.driver,
        "points": row.points,
        "qualifying_s": seconds_of(row.qualifying_us),
    }


def _seconds(time_us: int) -> float | None:
    return seconds_of(time_us) if time_us > 0 else None
