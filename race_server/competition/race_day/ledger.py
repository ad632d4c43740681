"""Results of a race day: every attempt, every race, and the order that follows."""

from dataclasses import dataclass, field

from race_server.competition.race_day.formats.format import LAP, Format, Races, TimeTrial
from race_server.competition.race_day.protest import Protest
from race_server.competition.race_day.record import RaceRecord, Team, TeamResult
from race_server.scenario.track.course import Course


@dataclass(frozen=True)
class TrialRow:
    """One team in a time trial."""

    team: str
    attempts: tuple[TeamResult, ...]
    times_us: tuple[int, ...]  # of the attempts, with the time of a failure for failed ones
    time_us: int  # the one that counts
    points: int


@dataclass(frozen=True)
class TrialResult:
    """A time trial, fastest team first."""

    stage: TimeTrial
    course: Course
    rows: tuple[TrialRow, ...]


@dataclass(frozen=True)
class Label:
    """Title and place of one race within its stage."""

    title: str  # such as "Heat 2"
    turn: int  # its round, from 1
    group: int  # from 1: the best where the groups are in order


@dataclass(frozen=True)
class Heat:
    """One race of several teams."""

    label: Label
    letter: str  # of its track
    course: Course
    grid: tuple[str, ...]  # teams, pole position first
    record: RaceRecord
    points: dict[str, int]  # by team


@dataclass(frozen=True)
class RacesResult:
    """All races of a stage, in the order in which they were run."""

    stage: Races
    heats: tuple[Heat, ...]


@dataclass(frozen=True)
class FinalRow:
    """One team in the final classification."""

    place: int  # 0: not classified
    team: str
    driver: str
    points: int
    qualifying_us: int  # sum of the times that counted


@dataclass
class Ledger:
    """All results so far."""

    format: Format
    teams: tuple[Team, ...]
    stages: list[TrialResult | RacesResult] = field(default_factory=list)
    protests: tuple[Protest, ...] = ()

    def trials(self) -> list[TrialResult]:
        """Return the time trials that were driven."""
        return [stage for stage in self.stages if isinstance(stage, TrialResult)]

    def heats(self) -> list[Heat]:
        """Return all races that were run, in order."""
        return [
            heat for stage in self.stages if isinstance(stage, RacesResult) for heat in stage.heats
        ]

    def points(self) -> dict[str, int]:
        """Return the points of each team so far."""
        total = {team.name: 0 for team in self.teams}
        for trial in self.trials():
            for row in trial.rows:
                total[row.team] += row.points
        for heat in self.heats():
            for name, points in heat.points.items():
                total[name] += points
        return total

    def qualifying_us(self) -> dict[str, int]:
        """Return the sum of the times that counted of each team."""
        total = {team.name: 0 for team in self.teams}
        for trial in self.trials():
            for row in trial.rows:
                total[row.team] += row.time_us
        return total

    def order(self) -> list[Team]:
        """Return the teams in order of the standings, which is the order of the grid.

        By points where the format has any, else by the sum of the times. Ties: see `_tie_break`.
        """
        points = self.points()
        return sorted(self.teams, key=lambda team: (-points[team.name], *self._tie_break(team)))

    def _tie_break(self, team: Team) -> tuple[object, ...]:
        """Order equal teams by better places, then shorter times, all attempts, the entry list.

        Better places: more wins, then more second places, and so on.
        """
        places = [0] * (len(self.teams) + 1)
        if self.format.has_points:
            for heat in self.heats():
                for drive in heat.record.drives:
                    places[drive.place] -= drive.team == team.name
        attempts = [
            sum(row.times_us)
            for trial in self.trials()
            for row in trial.rows
            if row.team == team.name
        ]
        number = self.teams.index(team)
        return tuple(places[1:]), self.qualifying_us()[team.name], sum(attempts), number

    def classification(self) -> list[FinalRow]:
        """Return the final order; teams that are not classified come last, with place 0."""
        ranked = self.order() if self.format.has_points else self._by_last_races()
        points, times = self.points(), self.qualifying_us()
        classified = self._classified()
        ranked = sorted(ranked, key=lambda team: team.name not in classified)
        return [
            FinalRow(
                place if team.name in classified else 0,
                team.name,
                team.driver,
                points[team.name],
                times[team.name],
            )
            for place, team in enumerate(ranked, start=1)
        ]

    def _by_last_races(self) -> list[Team]:
        """Return the teams by their last race: the first race of the stage before the second."""
        names = {team.name: team for team in self.teams}
        ranked: dict[str, Team] = {}
        last = [stage for stage in self.stages if isinstance(stage, RacesResult)][-1:]
        for stage in last:
            for heat in stage.heats:
                for drive in heat.record.drives:
                    if drive.place > 0:
                        ranked[drive.team] = names[drive.team]
        for team in self.order():
            ranked.setdefault(team.name, team)
        return list(ranked.values())

    def _classified(self) -> set[str]:
        """Return the teams that finished: with points any race or trial, else the last race.

        Before the first race is driven the trials decide.
        """
        if not self.format.has_points and self.heats():
            last = [stage for stage in self.stages if isinstance(stage, RacesResult)][-1:]
            heats = [heat for stage in last for heat in stage.heats]
            return {d.team for heat in heats for d in heat.record.drives if d.place > 0}
        raced = {d.team for heat in self.heats() for d in heat.record.drives if d.place > 0}
        timed = {
            row.team for trial in self.trials() for row in trial.rows if has_time(trial.stage, row)
        }
        return raced | timed


def has_time(stage: TimeTrial, row: TrialRow) -> bool:
    """Return whether an attempt of a team counts."""
    if stage.counts == LAP:
        return row.time_us < round(stage.failure_s * 1e6)
    return any(drive.place > 0 for drive in row.attempts)
