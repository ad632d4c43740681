"""What is known of one attempt or race after it: the same for drivers here and on the network."""

from collections.abc import Mapping
from dataclasses import dataclass

from race_server.competition.race_day.incidents import Incidents
from race_server.core.messages import Status
from race_server.session.session import Session


@dataclass(frozen=True)
class Team:
    """A participant: a unique name and an installed driver, or one on the network."""

    name: str
    driver: str


@dataclass(frozen=True)
class DeletedLap:
    """A lap that does not count, and why."""

    number: int  # from 1
    why: str


@dataclass(frozen=True)
class TeamResult:
    """Result of one team in one race."""

    team: str
    place: int  # in the race, from 1; 0: not classified
    laps: int
    time_us: int  # penalties included; 0: not finished
    best_lap_us: int  # 0: no lap
    lap_times_us: tuple[int, ...]
    penalty_us: int
    wall_contacts: int
    kart_contacts: int
    warnings: int
    remark: str
    deleted: tuple[DeletedLap, ...] = ()
    stewards_us: int = 0  # of the penalties those that stewards gave

    def clean_laps_us(self, first: int = 1) -> list[int]:
        """Return the times of the laps that count, from the lap `first` on."""
        gone = {lap.number for lap in self.deleted}
        laps = enumerate(self.lap_times_us, start=1)
        return [time for number, time in laps if number >= first and number not in gone]


@dataclass(frozen=True)
class RaceRecord:
    """A finished race: its results, best first, and the digest of its last tick."""

    digest: str
    drives: tuple[TeamResult, ...]
    grid: tuple[str, ...] = ()  # teams, pole position first


def record_of(session: Session, teams: Mapping[int, str], incidents: Incidents) -> RaceRecord:
    """Return the record of the race that a session has driven. teams: names by seat."""
    racers = session.world.racers[0]
    drives = []
    for row in session.standings():
        racer = racers[row.seat]
        has_finished = row.status is Status.FINISHED
        drives.append(
            TeamResult(
                team=teams[row.seat],
                place=row.rank if has_finished else 0,
                laps=row.laps,
                time_us=row.race_time_us,
                best_lap_us=row.best_lap_us,
                lap_times_us=row.lap_times_us,
                penalty_us=row.penalty_us,
                wall_contacts=int(racer.wall_contacts),
                kart_contacts=int(racer.contacts),
                warnings=int(racer.warnings),
                remark=incidents.of(row, session.scenario.rules),
                deleted=tuple(
                    DeletedLap(number, why) for number, why in incidents.deleted(row.seat)
                ),
                stewards_us=incidents.stewards_us(row.seat),
            )
        )
    lined = sorted(session.lined_up(), key=lambda seat: int(racers[seat.number].grid_place))
    return RaceRecord(session.digest(), tuple(drives), tuple(teams[s.number] for s in lined))


def absent(team: str, why: str) -> TeamResult:
    """Return the result of a team that did not start."""
    return TeamResult(team, 0, 0, 0, 0, (), 0, 0, 0, 0, f"did not start: {why}")
