"""The result of the last race, which stewards may change until the next one begins.

A penalty is added, and the order is worked out anew by the rules of the race itself.

The recording ends with the race: a penalty that comes later is in the results file and in the
result document, not in the recording and not in its digest.
"""

from collections.abc import Callable
from dataclasses import replace

from race_server.core.messages import Standing
from race_server.errors import SeatError
from race_server.live.server.publisher import Publisher
from race_server.live.server.result import RaceResult
from race_server.session import Session
from race_server.storage.results.keeper import Keeper


class Amendments:
    """What may still be changed about a race that is over."""

    def __init__(
        self,
        session: Session,
        publisher: Publisher,
        keeper: Keeper | None,
        amended: Callable[[RaceResult], None],
    ) -> None:
        """Have no result yet. amended: is told each result that replaces an earlier one."""
        self._session, self._publisher, self._keeper = session, publisher, keeper
        self._amended = amended
        self.result: RaceResult | None = None

    def lapse(self) -> None:
        """Let the last result stand: another race begins."""
        self.result = None

    def penalise(self, seat: int, seconds: float) -> str:
        """Add a penalty to the result of a seat and return its driver's name.

        Raises:
            SeatError: there is no result, or nobody raced on that seat.
        """
        result = self.result
        if result is None:
            raise SeatError("no race is on, and there is none whose result could be changed")
        driver = next((row.driver for row in result.standings if row.seat == seat), None)
        if driver is None:
            raise SeatError(f"nobody raced on seat {seat} in the last race")
        events = self._session.penalise_late(seat, seconds)
        standings = _amended(result.standings, {r.seat: r for r in self._session.table()})
        self.result = replace(result, standings=standings, events=[*result.events, *events])
        if self._keeper:
            self._keeper.amend(standings)
        self._publisher.publish_events(events)
        self._publisher.publish_standings()
        self._amended(self.result)
        return driver


def _amended(rows: list[Standing], now: dict[int, Standing]) -> list[Standing]:
    """Return rows of a result with rank and times as they are now, best place first."""
    changed = [
        replace(
            row,
            rank=now[row.seat].rank,
            race_time_us=now[row.seat].race_time_us,
            gap_us=now[row.seat].gap_us,
            penalties=now[row.seat].penalties,
            penalty_us=now[row.seat].penalty_us,
        )
        for row in rows
    ]
    return sorted(changed, key=lambda row: row.rank)
