"""Where protests are lodged and decided while an event goes on."""

from collections.abc import Callable
from dataclasses import replace

from race_server.competition.event_state import EventState
from race_server.competition.race_day.day import Day
from race_server.competition.race_day.protest import DISMISSED, DISQUALIFIED, OPEN, Protest
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
        protest = self._about(known[against], known[by], why)
        same = (one for one in day.protests if one.verdict == OPEN and one.drive == protest.drive)
        if any((one.by, one.against) == (protest.by, protest.against) for one in same):
            raise SeatError(
                f"{protest.by} has protested against {protest.against} already: the stewards have "
                "not decided yet",
                Reason.DECISION,
            )
        day.rule((*day.protests, protest))
        self._changed()
        return f"protest {protest.number}: {protest.by} against {protest.against}, {protest.title}"

    def disqualify(self, seat: int, why: str, who: str) -> str:
        """Take the last result of a seat from its team, and return a sentence on it.

        Raises:
            SeatError: it is no team of the event, or has no result that may still change.
        """
        if seat not in self._teams:
            raise SeatError(f"no team of the event has seat {seat}", Reason.DECISION)
        opened = self._about(self._teams[seat], "", why)
        self._rule(opened, DISQUALIFIED, 0.0, who)
        return f"{opened.against} disqualified, {opened.title}"

    def _about(self, against: str, by: str, why: str) -> Protest:
        """Return a protest about the newest result of a team that may still change."""
        day = self._day
        drive = day.last_of(against, self.block)
        if drive is None:
            raise SeatError(
                f"{against} has no result that may still change: its stage is over, or it has not "
                "driven in it",
                Reason.DECISION,
            )
        number, title = len(day.protests) + 1, day.driven[drive].title
        return Protest(number, drive, title, by, against, why.strip(), utc_now())

    def decide(self, number: int, verdict: str, seconds: float, who: str) -> str:
        """Decide a protest, and return a sentence on it. seconds: on the time, where upheld.

        verdict: UPHELD, DISQUALIFIED or DISMISSED, which takes an earlier decision back while the
        result may still change.

        Raises:
            SeatError: there is no such protest, or its decision stands.
        """
        day = self._day
        found = next((one for one in day.protests if one.number == number), None)
        if found is None:
            known = ", ".join(str(one.number) for one in day.protests) or "none"
            raise SeatError(f"there is no protest {number}; known: {known}", Reason.DECISION)
        if found.verdict == OPEN:
            return f"protest {number} {self._rule(found, verdict, seconds, who).outcome}"
        may_change = day.driven[found.drive].block == self.block
        if found.verdict == DISMISSED or verdict != DISMISSED or not may_change:
            way_out = "; to dismiss it takes that back" if may_change else ""
            way_out = way_out if found.verdict != DISMISSED else ""
            raise SeatError(
                f"protest {number} is decided: {found.outcome}{way_out}", Reason.DECISION
            )
        self._rule(found, DISMISSED, 0.0, who)
        return f"protest {number} dismissed, {found.outcome} taken back"

    def _rule(self, protest: Protest, verdict: str, seconds: float, who: str) -> Protest:
        """Put a protest with its decision in the place of the one without."""
        ruled = replace(
            protest, verdict=verdict, seconds=seconds, decided_at=utc_now(), decided_by=who
        )
        others = (one for one in self._day.protests if one.number != protest.number)
        self._day.rule(tuple(sorted((*others, ruled), key=lambda one: one.number)))
        self.correct(protest.drive)
        self._changed()
        return ruled

    def correct(self, drive: int) -> None:
        """Change a result in the results file to what decisions on protests make of it."""
        result = self._day.results[drive]
        if self._keeper is None:
            return
        rows = tuple(
            (place, one.time_us, one.penalty_us, self._seats[one.team])
            for place, one in enumerate(result.drives, start=1)
        )
        title = self._day.driven[drive].title
        self._keeper.correct(Correction(self._day.event, title, rows))
