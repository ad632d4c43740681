"""A race day: all stages of a format in order."""

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

from race_server.competition.race_day.formats import Format, Races, TimeTrial
from race_server.competition.race_day.ledger import Heat, Label, Ledger, RacesResult, TrialResult
from race_server.competition.race_day.obstacles import with_obstacles
from race_server.competition.race_day.points import groups_in_order, mixed_groups, place_points
from race_server.competition.race_day.qualify import run_trial
from race_server.competition.race_day.race import LocalRace, Team, rehearse
from race_server.core.driver import driver_named
from race_server.core.observation import wants_line
from race_server.core.vehicles import Vehicle
from race_server.errors import DriverError, ScenarioError
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.raceline.attach import with_line
from race_server.scenario.track.check import check_course
from race_server.scenario.track.course import Course
from race_server.storage.results.keeper import Keeper

# The rules say 2 m for cars of 0.45 m; other vehicles in proportion.
WRONG_WAY_LENGTHS = 2.0 / 0.45
# From this share of the top speed a hit from behind counts as deliberate: 1 m/s for the 1/10 car.
RAM_SHARE = 0.1

Tell = Callable[[str], None]


@dataclass(frozen=True)
class DayPlan:
    """A race day before it begins."""

    format: Format
    teams: tuple[Team, ...]
    courses: Mapping[str, Course]  # by letter
    vehicle: Vehicle
    seed: int

    @property
    def session(self) -> str:
        """Session name of the day in the results."""
        return f"day-{self.format.name}-{self.seed}"

    def rules(self, stage: TimeTrial | Races) -> Rules:
        """Return the rules of a stage: no items, no rescue, removal as in the real event."""
        limit = stage.failure_s if isinstance(stage, TimeTrial) else stage.limit_s * stage.laps
        return Rules(
            laps=stage.laps,
            items=False,
            catch_up=False,
            stuck_s=0.0,
            stopped_limit_s=10.0,
            wrong_way_removal=WRONG_WAY_LENGTHS * self.vehicle.length,
            ram_speed=RAM_SHARE * self.vehicle.top_speed,
            limit_s=limit,
        )

    def course_of(self, stage: TimeTrial) -> Course:
        """Return the course of a time trial, with its obstacles."""
        course = self.courses[stage.track]
        if stage.obstacles is None:
            return course
        return with_obstacles(course, stage.obstacles, self.vehicle, self.seed_of(stage.name))

    def seed_of(self, *words: str) -> int:
        """Return the seed of one part of the day, different for each."""
        text = "/".join([str(self.seed), *words])
        return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=4).digest(), "big")


def teams_of(drivers: Sequence[str]) -> tuple[Team, ...]:
    """Return a team for each driver, named after it; the second of a kind is numbered 2."""
    seen: dict[str, int] = {}
    teams = []
    for driver in drivers:
        seen[driver] = seen.get(driver, 0) + 1
        number = f" {seen[driver]}" if seen[driver] > 1 else ""
        teams.append(Team(driver + number, driver))
    return tuple(teams)


def drives_in(plan: DayPlan) -> int:
    """Return how many attempts and races the day has."""
    count = 0
    for stage in plan.format.stages:
        if isinstance(stage, TimeTrial):
            count += stage.attempts * len(plan.teams)
        else:
            groups = _groups(stage, list(plan.teams))
            count += stage.rounds * len(stage.tracks) * len(groups)
    return count


def check_day_plan(plan: DayPlan) -> None:
    """Check before the first race that every stage can be run.

    Raises:
        ScenarioError: there are no teams, a course cannot be lapped by the vehicle, or has no
            room for a race or an obstacle.
    """
    if not plan.teams:
        raise ScenarioError("a race day needs drivers: give one or more")
    for course in plan.courses.values():
        for issue in check_course(course, plan.vehicle):
            if issue.level == "error":
                raise ScenarioError(f"{course.name} cannot be used on this day: {issue.what}")
    for stage in plan.format.stages:
        if isinstance(stage, TimeTrial):
            plan.course_of(stage)
            continue
        most = max(len(group) for group in _groups(stage, list(plan.teams)))
        for letter in stage.tracks:
            course = plan.courses[letter]
            if len(course.grid) < most:
                raise ScenarioError(
                    f"{course.name} has {len(course.grid)} places on its grid, "
                    f"{stage.name.lower()} needs {most}; choose another track or fewer drivers"
                )


def run_day(plan: DayPlan, keeper: Keeper | None, tell: Tell) -> Ledger:
    """Run the stages one after the other; call `tell` with the title of each attempt and race.

    Raises:
        ScenarioError: a stage cannot be run.
    """
    check_day_plan(plan)
    _rehearse(plan)
    ledger = Ledger(plan.format, plan.teams)
    for stage in plan.format.stages:
        if isinstance(stage, TimeTrial):
            ledger.stages.append(_run_trial(plan, stage, keeper, tell))
        else:
            ledger.stages.append(RacesResult(stage, ()))
            for turn in range(1, stage.rounds + 1):
                _run_round(plan, stage, turn, ledger, keeper, tell)
    return ledger


def _rehearse(plan: DayPlan) -> None:
    stage = plan.format.stages[0]
    course = plan.courses[plan.format.letters[0]]
    scenario = _scenario(plan, stage, course, min(len(course.grid), len(plan.teams)))
    rehearse([team.driver for team in plan.teams], scenario)


def _scenario(plan: DayPlan, stage: TimeTrial | Races, course: Course, karts: int) -> Scenario:
    """Return one race of a stage, with the reference line if a driver needs it."""
    scenario = Scenario(course, karts, vehicles=(plan.vehicle,), rules=plan.rules(stage))
    return with_line(scenario, solve=any(_wants_line(team.driver) for team in plan.teams))


def _wants_line(driver: str) -> bool:
    try:
        return wants_line(driver_named(driver).preset)
    except DriverError:  # recorded as an incident when its turn comes
        return False


def _run_trial(plan: DayPlan, stage: TimeTrial, keeper: Keeper | None, tell: Tell) -> TrialResult:
    course = plan.course_of(stage)
    scenario = _scenario(plan, stage, course, 1)
    race = LocalRace(f"{plan.session}-{_slug(stage.name)}", scenario, keeper)
    return run_trial(
        stage, course, race, plan.teams, lambda attempt: plan.seed_of(stage.name, attempt), tell
    )


def _run_round(
    plan: DayPlan, stage: Races, turn: int, ledger: Ledger, keeper: Keeper | None, tell: Tell
) -> None:
    """Run the races of one round. The groups stay together; the grid follows the standings."""
    groups = _groups(stage, ledger.order())
    for letter in stage.tracks:
        for number, group in enumerate(groups, start=1):
            title = stage.name + (f" {number}" if len(groups) > 1 else "")
            title += f", round {turn}" if stage.rounds > 1 else ""
            tell(f"{title}, track {letter}")
            grid = [team for team in ledger.order() if team in group]
            heat = _run_heat(plan, stage, grid, letter, Label(title, turn, number), keeper)
            result = ledger.stages[-1]
            assert isinstance(result, RacesResult)
            ledger.stages[-1] = replace(result, heats=(*result.heats, heat))


def _run_heat(
    plan: DayPlan,
    stage: Races,
    grid: list[Team],
    letter: str,
    label: Label,
    keeper: Keeper | None,
) -> Heat:
    course = plan.courses[letter]
    scenario = _scenario(plan, stage, course, len(grid))
    race = LocalRace(f"{plan.session}-{_slug(label.title)}", scenario, keeper)
    record = race.run(grid, plan.seed_of(label.title, letter))
    points = {
        drive.team: place_points(drive.place, stage.points, stage.finishing)
        for drive in record.drives
    }
    return Heat(label, letter, course, tuple(team.name for team in grid), record, points)


def _groups(stage: Races, teams: list[Team]) -> list[list[Team]]:
    """Return the teams of each race; `teams` in order of the standings."""
    chosen = teams[: stage.qualified or None]
    if stage.mixed:
        return mixed_groups(chosen, stage.most)
    return groups_in_order(chosen, stage.most, stage.least)


def _slug(words: str) -> str:
    return "-".join("".join(c if c.isalnum() else " " for c in words.lower()).split())
