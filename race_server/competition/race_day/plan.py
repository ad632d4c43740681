"""An event before it begins: its format, its teams, its courses, and the rules of each stage."""

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass, replace

from race_server.competition.race_day.formats import LAP, Format, Races, TimeTrial
from race_server.competition.race_day.obstacles import with_obstacles
from race_server.competition.race_day.points import groups_in_order, mixed_groups
from race_server.competition.race_day.record import Team
from race_server.competition.time_trial.run_spec import (
    RunSpec,
    on_the_mark,
    rules_of,
    world_seed,
)
from race_server.core.seeds import MOST_SEED
from race_server.core.vehicles import Vehicle
from race_server.errors import ScenarioError
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.raceline.attach import with_line
from race_server.scenario.track.check import check_course
from race_server.scenario.track.course import Course

# The rules say 2 m for cars of 0.45 m; other vehicles in proportion.
WRONG_WAY_LENGTHS = 2.0 / 0.45
# From this share of the top speed a hit from behind counts as deliberate: 1 m/s for the 1/10 car.
RAM_SHARE = 0.1


@dataclass(frozen=True)
class DayPlan:
    """An event before it begins."""

    format: Format
    teams: tuple[Team, ...]
    courses: Mapping[str, Course]  # by letter
    vehicle: Vehicle
    seed: int
    needs_line: bool = False  # a driver observes the reference line
    waits: bool = True  # the world waits for its drivers, so that no attempt needs a countdown

    @property
    def session(self) -> str:
        """Session name of the day in the results."""
        return f"day-{self.format.name}-{self.seed}"

    def rules(self, stage: TimeTrial | Races) -> Rules:
        """Return the rules of a stage: no items, no rescue, removal as in the real event.

        Where the best lap counts they are those of `race trial`.
        """
        if isinstance(stage, TimeTrial) and stage.counts == LAP:
            countdown_s = 0.0 if self.waits else Rules.countdown_s
            rules = rules_of(_spec_of(stage), self.courses[stage.track], self.vehicle)
            return replace(rules, countdown_s=countdown_s, limit_s=stage.failure_s)
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

    def scenario(self, stage: TimeTrial | Races, course: Course, karts: int) -> Scenario:
        """Return one race of a stage on a course, with the reference line if a driver needs it."""
        vehicles, rules = (self.vehicle,), self.rules(stage)
        return with_line(
            Scenario(course, karts, vehicles=vehicles, rules=rules), solve=self.needs_line
        )

    def attempt(self, stage: TimeTrial, scenario: Scenario, team: str, number: int) -> Scenario:
        """Return the scenario of an attempt. number: from 1.

        Where the best lap counts all teams have the same chances in it: those of the run of `race
        trial` whose seed is that of the event for the first attempt, one more for the second …
        """
        if stage.counts != LAP:
            return replace(scenario, seed=self.seed_of(stage.name, f"{team} {number}"))
        seed = self.seed + number - 1
        grid = on_the_mark(scenario.course, self.vehicle, seed)
        course = replace(scenario.course, grid=grid)
        return replace(scenario, course=course, seed=world_seed(seed))

    def groups(self, stage: Races, teams: list[Team]) -> list[list[Team]]:
        """Return the teams of each race; `teams` in order of the standings."""
        chosen = teams[: stage.qualified or None]
        if stage.mixed:
            return mixed_groups(chosen, stage.most)
        return groups_in_order(chosen, stage.most, stage.least)

    def seed_of(self, *words: str) -> int:
        """Return the seed of one part of the day, different for each."""
        text = "/".join([str(self.seed), *words])
        return int.from_bytes(hashlib.blake2b(text.encode(), digest_size=4).digest(), "big")

    def drives(self) -> int:
        """Return how many attempts and races the event has."""
        count = 0
        for stage in self.format.stages:
            if isinstance(stage, TimeTrial):
                count += stage.attempts * len(self.teams)
            else:
                groups = self.groups(stage, list(self.teams))
                count += stage.rounds * len(stage.tracks) * len(groups)
        return count

    def check(self) -> None:
        """Check before the first race that every stage can be run.

        Raises:
            ScenarioError: there are no teams, an attempt has no seed, a course cannot be lapped by
                the vehicle, or has no room for a race or an obstacle.
        """
        if not self.teams:
            raise ScenarioError("a race day needs drivers: give one or more")
        trials = [one for one in self.format.stages if isinstance(one, TimeTrial)]
        last = MOST_SEED + 1 - max((one.attempts for one in trials), default=1)
        if not 0 <= self.seed <= last:
            raise ScenarioError(
                f"--seed {self.seed}: each attempt has a seed one larger than the one before; "
                f"choose one from 0 to {last}"
            )
        for course in self.courses.values():
            for issue in check_course(course, self.vehicle):
                if issue.level == "error":
                    raise ScenarioError(f"{course.name} cannot be used on this day: {issue.what}")
        for stage in self.format.stages:
            if isinstance(stage, TimeTrial):
                self.course_of(stage)
                continue
            most = max(len(group) for group in self.groups(stage, list(self.teams)))
            for letter in stage.tracks:
                course = self.courses[letter]
                if len(course.grid) < most:
                    raise ScenarioError(
                        f"{course.name} has {len(course.grid)} places on its grid, "
                        f"{stage.name.lower()} needs {most}; choose another track or fewer drivers"
                    )


def _spec_of(stage: TimeTrial) -> RunSpec:
    return RunSpec("", "", laps=stage.laps, start=stage.start)


def teams_of(drivers: list[str] | tuple[str, ...]) -> tuple[Team, ...]:
    """Return a team for each driver, named after it; the second of a kind is numbered 2.

    A number that makes the name of another driver is left out.
    """
    teams: dict[str, Team] = {}
    for driver in drivers:
        name, number = driver, 1
        while name in teams or (number > 1 and name in drivers):
            number += 1
            name = f"{driver} {number}"
        teams[name] = Team(name, driver)
    return tuple(teams.values())
