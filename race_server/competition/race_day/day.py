"""An event as it goes: its attempts and races in order, and the ledger so far.

The same for an event inside one process (`run_day`) and one on the network
(`race_server.competition.live_event`).
"""

from collections.abc import Callable, Generator, Iterable, Sequence
from copy import copy
from dataclasses import dataclass, replace

from race_server.competition.race_day.formats import Races, TimeTrial
from race_server.competition.race_day.ledger import Heat, Label, Ledger, RacesResult
from race_server.competition.race_day.plan import DayPlan
from race_server.competition.race_day.points import place_points
from race_server.competition.race_day.protest import Protest, result_of
from race_server.competition.race_day.qualify import trial_result
from race_server.competition.race_day.race import LocalRace, needs_line, rehearse
from race_server.competition.race_day.record import RaceRecord, Team, TeamResult
from race_server.errors import ScenarioError
from race_server.scenario.race import Occasion, Scenario
from race_server.storage.results.keeper import Keeper

Tell = Callable[[str], None]
# The title of an attempt or a race, and its teams.
Call = tuple[str, tuple[Team, ...]]


@dataclass(frozen=True)
class Drive:
    """An attempt or a race that is to be driven."""

    title: str
    session: str  # name in the results of a day in one process
    grid: tuple[Team, ...]  # pole position first
    scenario: Scenario
    stage: TimeTrial | Races
    block: str  # until the next block begins its results may change: they order no grid before
    coming: tuple[Call, ...]  # after it in the same stage, or round; the grids are not known yet


class Day:
    """An event: the drive that comes next, and the results of those before."""

    def __init__(
        self,
        plan: DayPlan,
        event: str = "",
        records: Iterable[RaceRecord] = (),
        protests: tuple[Protest, ...] = (),
    ) -> None:
        """Begin, or go on after the drives with these records.

        event: its name, empty for none; protests: so far.

        Raises:
            ScenarioError: there are more records than attempts and races.
        """
        self.plan, self.event, self.protests = plan, event or plan.session, protests
        self._scenarios: dict[tuple[str, str, int], Scenario] = {}
        self._begin()
        for record in records:
            self.add(record)

    def _begin(self) -> None:
        self.ledger = Ledger(self.plan.format, self.plan.teams, protests=self.protests)
        self.records: list[RaceRecord] = []  # as they were driven
        self.results: list[RaceRecord] = []  # with what protests changed
        self.driven: list[Drive] = []
        self._drives = self._run()
        self.next: Drive | None = next(self._drives, None)

    def add(self, record: RaceRecord) -> None:
        """Record the drive that was next.

        Raises:
            ScenarioError: there is none.
        """
        if self.next is None:
            raise ScenarioError(
                f"event {self.event} is over after {len(self.records)} attempts and races; there "
                "is a record of one more"
            )
        number = len(self.records)
        about = [protest for protest in self.protests if protest.drive == number]
        self.driven.append(self.next)
        self.records.append(record)
        self.results.append(result_of(record, about))
        try:
            self.next = self._drives.send(self.results[-1])
        except StopIteration:
            self.next = None

    def amend(self, number: int, record: RaceRecord) -> None:
        """Replace the record of a drive, and all that follows from it. number: from 0.

        Raises:
            ScenarioError: its stage, or its round of races, is over: others were grouped by it.
        """
        block, newest = self.driven[number].block, self.driven[-1].block
        if block != newest:
            raise ScenarioError(f"{block} is over, and {newest} has begun")
        self._drive_again([*self.records[:number], record, *self.records[number + 1 :]])

    def rule(self, protests: tuple[Protest, ...]) -> None:
        """Replace the protests, and all that follows from them."""
        self.protests = protests
        self._drive_again(self.records)

    def last_of(self, team: str, block: str) -> int | None:
        """Return the newest record of a block with a team, None where there is none."""
        for number in reversed(range(len(self.driven))):
            if self.driven[number].block != block:
                return None
            if any(drive.team == team for drive in self.records[number].drives):
                return number
        return None

    def _drive_again(self, records: Sequence[RaceRecord]) -> None:
        self._begin()
        for record in records:
            self.add(record)

    def with_record(self, record: RaceRecord) -> "Day":
        """Return the event as it would be after the drive that is next."""
        other = copy(self)
        other._drive_again([*self.records, record])
        return other

    def _run(self) -> Generator[Drive, RaceRecord, None]:
        for stage in self.plan.format.stages:
            if isinstance(stage, TimeTrial):
                yield from self._run_trial(stage)
            else:
                self.ledger.stages.append(RacesResult(stage, ()))
                for turn in range(1, stage.rounds + 1):
                    yield from self._run_round(stage, turn)

    def _run_trial(self, stage: TimeTrial) -> Generator[Drive, RaceRecord, None]:
        """Run the attempts of every team, all first ones before the second ones."""
        plan = self.plan
        attempts: dict[str, list[TeamResult]] = {team.name: [] for team in plan.teams}
        turns = [(team, number) for number in range(1, stage.attempts + 1) for team in plan.teams]
        calls = [(attempt_title(stage, *turn), turn[:1]) for turn in turns]
        for place, (team, number) in enumerate(turns):
            common = self._scenario(stage, stage.track, 1)
            scenario = plan.attempt(stage, common, team.name, number)
            session = f"{plan.session}-{_slug(stage.name)}"
            record = yield self._drive(calls[place:], session, scenario, stage, stage.name)
            attempts[team.name].append(record.drives[0])
            done = trial_result(stage, common.course, attempts)
            if place == 0:
                self.ledger.stages.append(done)
            self.ledger.stages[-1] = done

    def _run_round(self, stage: Races, turn: int) -> Generator[Drive, RaceRecord, None]:
        """Run the races of one round. The groups stay together; the grid follows the standings."""
        plan, ledger = self.plan, self.ledger
        groups = plan.groups(stage, ledger.order())
        turns = [
            (letter, number, group, _race_title(stage, turn, number if len(groups) > 1 else 0))
            for letter in stage.tracks
            for number, group in enumerate(groups, start=1)
        ]
        calls = [(f"{title}, track {letter}", tuple(group)) for letter, _, group, title in turns]
        for place, (letter, number, group, title) in enumerate(turns):
            grid = tuple(team for team in ledger.order() if team in group)
            calls[place] = (calls[place][0], grid)
            common = self._scenario(stage, letter, len(grid))
            scenario = replace(common, seed=plan.seed_of(title, letter))
            session, block = f"{plan.session}-{_slug(title)}", f"{stage.name} {turn}"
            record = yield self._drive(calls[place:], session, scenario, stage, block)
            points = {
                drive.team: place_points(drive.place, stage.points, stage.finishing)
                for drive in record.drives
            }
            label = Label(title, turn, number)
            names = record.grid or tuple(team.name for team in grid)
            heat = Heat(label, letter, common.course, names, record, points)
            result = ledger.stages[-1]
            assert isinstance(result, RacesResult)
            ledger.stages[-1] = replace(result, heats=(*result.heats, heat))

    def _scenario(self, stage: TimeTrial | Races, letter: str, karts: int) -> Scenario:
        """Return what all races of a stage on one track share; solved lines are kept."""
        key = stage.name, letter, karts
        if key not in self._scenarios:
            plan = self.plan
            course = plan.course_of(stage) if isinstance(stage, TimeTrial) else plan.courses[letter]
            self._scenarios[key] = plan.scenario(stage, course, karts)
        return self._scenarios[key]

    def _drive(
        self,
        calls: Sequence[Call],
        session: str,
        scenario: Scenario,
        stage: TimeTrial | Races,
        block: str,
    ) -> Drive:
        """Return the first of these calls as a drive."""
        (title, grid), *coming = calls
        occasion = Occasion(self.event, self.plan.format.name, title)
        timed = replace(scenario, occasion=occasion)
        return Drive(title, session, grid, timed, stage, block, tuple(coming))


def attempt_title(stage: TimeTrial, team: Team, number: int) -> str:
    """Return the title of an attempt. number: from 1."""
    return f"{stage.name}: {team.name}, attempt {number}"


def _race_title(stage: Races, turn: int, number: int) -> str:
    """Return the title of a race. number: of its group, from 1; 0 where there is one group."""
    return stage.name + (f" {number}" * (number > 0)) + (f", round {turn}" * (stage.rounds > 1))


def run_day(plan: DayPlan, keeper: Keeper | None, tell: Tell) -> Ledger:
    """Run the stages one after the other; call `tell` with the title of each attempt and race.

    Raises:
        ScenarioError: a stage cannot be run.
    """
    plan.check()
    plan = replace(plan, needs_line=any(needs_line(team.driver) for team in plan.teams))
    _rehearse(plan)
    day = Day(plan)
    while (drive := day.next) is not None:
        tell(drive.title)
        race = LocalRace(drive.session, drive.scenario, keeper)
        day.add(race.run(drive.grid, drive.scenario.seed))
    return day.ledger


def _rehearse(plan: DayPlan) -> None:
    stage = plan.format.stages[0]
    course = plan.courses[plan.format.letters[0]]
    karts = min(len(course.grid), len(plan.teams))
    rehearse([team.driver for team in plan.teams], plan.scenario(stage, course, karts))


def _slug(words: str) -> str:
    return "-".join("".join(c if c.isalnum() else " " for c in words.lower()).split())
