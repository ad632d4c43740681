"""The result of a race, which stewards may change until the next one begins.

The recording ends with the race: a penalty that comes later is in the results file and in the
result document, not in the recording and not in its digest.
"""

from dataclasses import asdict, dataclass, field, replace
from typing import Any

from race_server.core.messages import Event, Standing
from race_server.errors import SeatError
from race_server.session.session import Session


@dataclass(frozen=True)
class RaceResult:
    """The result of a race."""

    digest: str
    ticks: int
    standings: list[Standing]  # best place first
    events: list[Event]
    missed_ticks: int
    refused: dict[str, int]  # messages, by reason
    tracked: list[dict[str, Any]] = field(default_factory=list)  # links of real karts

    @classmethod
    def of(
        cls,
        session: Session,
        events: list[Event],
        missed_ticks: int,
        refused: dict[str, int],
        now_us: int,
    ) -> "RaceResult":
        """Return the result of a session's race as it is now. now_us: of the real karts' clock."""
        return cls(
            session.digest(),
            session.tick,
            session.standings(),
            events,
            missed_ticks,
            refused,
            session.tracked_karts.figures(now_us),
        )

    def driver_on(self, seat: int) -> str:
        """Return the name of the driver who raced on a seat.

        Raises:
            SeatError: no driver did.
        """
        for row in self.standings:
            if row.seat == seat:
                return row.driver
        raise SeatError(
            f"no driver raced on seat {seat} in the last race; in an event protests are about "
            "earlier ones"
        )

    def amended(self, table: list[Standing], events: list[Event]) -> "RaceResult":
        """Return the result with ranks, times and penalties as they are now.

        table: one row for each seat; events: that came after the race.
        """
        now = {row.seat: row for row in table}
        standings = [_amended(row, now[row.seat]) for row in self.standings]
        standings.sort(key=lambda row: row.rank)
        return replace(self, standings=standings, events=[*self.events, *events])

    def as_json(self) -> dict[str, Any]:
        """Return the result as plain data: the document that `--json` prints."""
        karts = [row.as_json() for row in self.standings]
        return {
            "digest": self.digest,
            "ticks": self.ticks,
            "karts": karts,
            "events": [{**asdict(event), "kind": event.kind.name.lower()} for event in self.events],
            "missed_ticks": self.missed_ticks,
            "refused": self.refused,
            "tracked": self.tracked,
        }


def _amended(row: Standing, now: Standing) -> Standing:
    return replace(
        row,
        rank=now.rank,
        race_time_us=now.race_time_us,
        gap_us=now.gap_us,
        penalties=now.penalties,
        penalty_us=now.penalty_us,
    )
