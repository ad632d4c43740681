"""A time trial: each team alone, several attempts, the best counts."""

from collections.abc import Callable, Sequence

from race_server.competition.race_day.formats.format import TimeTrial
from race_server.competition.race_day.ledger import TrialResult, TrialRow
from race_server.competition.race_day.points import falling_points
from race_server.competition.race_day.race import LocalRace, Team, TeamResult
from race_server.scenario.track.course import Course


def run_trial(
    stage: TimeTrial,
    course: Course,
    race: LocalRace,
    teams: Sequence[Team],
    seed_for: Callable[[str], int],
    tell: Callable[[str], None],
) -> TrialResult:
    """Run the attempts of every team, all first ones before the second ones.

    race: a session of one kart on the course; seed_for: returns the seed of an attempt; tell:
    called with the title of each attempt.
    """
    attempts: dict[str, list[TeamResult]] = {team.name: [] for team in teams}
    for number in range(1, stage.attempts + 1):
        for team in teams:
            tell(f"{stage.name}: {team.name}, attempt {number}")
            record = race.run([team], seed_for(f"{team.name} {number}"))
            attempts[team.name].append(record.drives[0])
    return trial_result(stage, course, attempts)


def trial_result(
    stage: TimeTrial, course: Course, attempts: dict[str, list[TeamResult]]
) -> TrialResult:
    """Return the teams by their best times; teams with equal times keep their order."""
    failure_us = round(stage.failure_s * 1e6)
    times = {
        name: tuple(counted_us(drive, failure_us) for drive in drives)
        for name, drives in attempts.items()
    }
    order = sorted(times, key=lambda name: (min(times[name]), sum(times[name])))
    best = [min(times[name]) for name in order]
    points = falling_points(best, stage.best_points, stage.least_points)
    rows = [
        TrialRow(name, tuple(attempts[name]), times[name], best[place], points[place])
        for place, name in enumerate(order)
    ]
    return TrialResult(stage, course, tuple(rows))


def counted_us(drive: TeamResult, failure_us: int) -> int:
    """Return the time [µs] of an attempt, at most that of a failed one."""
    return min(drive.time_us, failure_us) if drive.place > 0 else failure_us
