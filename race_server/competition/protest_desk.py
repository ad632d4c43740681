"""Where protests are lodged and decided while an event goes on."""

from collections.abc import Callable
from dataclasses import replace

from race_server.competition.event_state import EventState
from race_server.competition.race_day.day import Day
from race_server.competition.race_day.protest import DISMISSED, OPEN, UPHELD, Protest
from race_server.errors import Reason, SeatError
from race_server.storage.results.keeper import Keeper, utc_now
from race_server.storage.results.store import Correction


class ProtestDesk:
    """The protests of one event. One is lodged until its stage, or round of races, is closed."""

    def __init__(
        self, day: Day, state: EventState, keeper: Keeper | None, changed: Callable[[], None]
    ) -> None:
        """Go on with the protests of an event. changed: is called with each change."""
        self._day, self._keeper, self._changed = day, keeper, changed
        self._teams = {one.seat: one.team for one in state.entrants}
        self._seats = {one.team: one.seat for one in state.entrants}
        self.block = ""  # whose results may be protested against

    @property
    def is_busy(self) -> bool:
        """Whether a protest waits for its decision."""
        return any(one.verdict == OPEN for one in self._day.protests)

    def lodge(self, by: int, against: int, why: str) -> str:
        """Lodge a protest of one seat against another, and return a sentence on it.

        Raises:
            SeatError: they are no two teams of the event, or there is nothing to protest against.
        """
        day, known = self._day, self._teams
        for seat in (by, against):
            if seat not in known:
                raise SeatError(f"no team of the event has seat {seat}", Reason.DECISION)
        if by == against:
            raise SeatError(f"a team does not protest against itself: seat {by}", Reason.DECISION)
        drive = self._last_of(known[against])
        if drive is None:
            raise SeatError(
                f"{known[against]} has no result that may still change: its stage is over, or it "
                "has not driven in it",
                Reason.DECISION,
            )
        number, title = len(day.protests) + 1, day.driven[drive].title
        protest = Protest(number, drive, title, known[by], known[against], why.strip(), utc_now())
        day.rule((*day.protests, protest))
        self._changed()
        return f"protest {number}: {known[by]} against {known[against]}, {title}"

    def decide(self, number: int, seconds: float, who: str) -> str:
        """Uphold a protest with seconds on the time, or dismiss it with 0; return a sentence.

        Raises:
            SeatError: there is no such protest, or it is decided.
        """
        day = self._day
        found = next((one for one in day.protests if one.number == number), None)
        if found is None or found.verdict != OPEN:
            decided = f"protest {number} is decided: {found.outcome}" if found else ""
            raise SeatError(decided or f"there is no protest {number}", Reason.DECISION)
        verdict = UPHELD if seconds else DISMISSED
        ruled = replace(
            found, verdict=verdict, seconds=seconds, decided_at=utc_now(), decided_by=who
        )
        day.rule(tuple(ruled if one is found else one for one in day.protests))
        if seconds:
            self.correct(found.drive)
        self._changed()
        return f"protest {number} {ruled.outcome}"

    def correct(self, drive: int) -> None:
        """Change a result in the results file, where protests about it were upheld."""
        result = self._day.results[drive]
        if self._keeper is None or result is self._day.records[drive]:
            return
        rows = tuple(
            (one.place, one.time_us, one.penalty_us, self._seats[one.team])
            for one in result.drives
            if one.place
        )
        title = self._day.driven[drive].title
        self._keeper.correct(Correction(self._day.event, title, rows))

    def _last_of(self, team: str) -> int | None:
        """Return the newest record with a team whose result may still change."""
        for number in reversed(range(len(self._day.driven))):
            if self._day.driven[number].block != self.block:
                return None
            if any(drive.team == team for drive in self._day.records[number].drives):
                return number
        return None
