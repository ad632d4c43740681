"""A time trial: each team alone, several attempts, the best counts."""

from collections.abc import Mapping, Sequence

from race_server.competition.race_day.formats.format import LAP, TimeTrial
from race_server.competition.race_day.ledger import TrialResult, TrialRow
from race_server.competition.race_day.points import falling_points
from race_server.competition.race_day.record import TeamResult
from race_server.scenario.track.course import Course


def trial_result(
    stage: TimeTrial, course: Course, attempts: Mapping[str, Sequence[TeamResult]]
) -> TrialResult:
    """Return the teams by their best times; teams with equal times keep their order.

    attempts: of each team so far; one without any has the time of a failure.
    """
    failure_us = round(stage.failure_s * 1e6)
    times = {
        name: tuple(counted_us(stage, drive) for drive in drives)
        for name, drives in attempts.items()
    }
    best = {name: min(mine, default=failure_us) for name, mine in times.items()}
    order = sorted(times, key=lambda name: (best[name], sum(times[name])))
    points = falling_points([best[name] for name in order], stage.best_points, stage.least_points)
    rows = [
        TrialRow(name, tuple(attempts[name]), times[name], best[name], points[place])
        for place, name in enumerate(order)
    ]
    return TrialResult(stage, course, tuple(rows))


def counted_us(stage: TimeTrial, drive: TeamResult) -> int:
    """Return the time [µs] of an attempt, at most that of a failed one.

    Where the best lap counts an attempt that ended early has the laps until then, and penalties of
    stewards are added to the lap: those of the rules have cost a lap already.
    """
    failure_us = round(stage.failure_s * 1e6)
    if stage.counts == LAP:
        laps = drive.clean_laps_us(stage.first_lap)
        return min(min(laps) + drive.stewards_us, failure_us) if laps else failure_us
    return min(drive.time_us, failure_us) if drive.place > 0 else failure_us
