"""The steward: flags, penalties, closed seats, the clock, restarts of the race."""

import secrets
from collections import deque
from collections.abc import Callable
from datetime import UTC, datetime
from typing import Protocol

from race_server.core.messages import Fault, Flag
from race_server.errors import Reason, SeatError
from race_server.logs import Log
from race_server.net.wire.admin import Decision
from race_server.session.parking import ITS_OWN
from race_server.session.session import Session

# At most this many decisions are kept in the log.
MOST_LINES = 500
# A penalty beyond this is a slip of the finger.
MOST_PENALTY_S = 600.0


class Court(Protocol):
    """Takes protests in an event, and what stewards decide on them."""

    def lodge(self, by: int, against: int, why: str) -> str:
        """Lodge a protest of one seat against another, and return a sentence on it."""

    def decide(self, number: int, verdict: str, seconds: float, who: str) -> str:
        """Decide a protest, and return a sentence on it. seconds: on the time, where upheld."""

    def disqualify(self, seat: int, why: str, who: str) -> str:
        """Take the last result of a seat from its team, and return a sentence on it."""


def _refuse_to_park(_seat: int, _slot: int) -> None:
    raise SeatError("there is no car park here", Reason.DECISION)


def _refuse_late(_seat: int, _seconds: float) -> str:
    raise SeatError("no race is on", Reason.DECISION)


class Steward:
    """Carries out decisions of the steward and logs them."""

    def __init__(
        self,
        session: Session,
        token: str,
        penalise_late: Callable[[int, float], str] = _refuse_late,
        park: Callable[[int, int], None] = _refuse_to_park,
        log: Log | None = None,
    ) -> None:
        """Obey a client that shows the token.

        token: "" for no steward. penalise_late: changes the result of a race that is over, and
        returns the driver's name. park: has the vehicle of a seat parked in a slot. log: outlives
        this server, whose own lines go with it.
        """
        self._session = session
        self._park_seat = park
        self._penalise_late = penalise_late
        self._token, self._log = token, log
        self.challenge = secrets.randbits(63) | 1
        self.lines: deque[str] = deque(maxlen=MOST_LINES)
        self.wants_restart = False
        self.court: Court | None = None  # only in an event

    def check(self, decision: Decision) -> None:
        """Do nothing for a request that shows the steward's token.

        Raises:
            SeatError: it does not.
        """
        fits = secrets.compare_digest(decision.token.encode(), self._token.encode())
        if not self._token or not fits:
            raise SeatError("only the steward may do that: the token does not fit", Reason.STEWARD)

    def decide(self, decision: Decision) -> None:
        """Carry out a decision.

        Raises:
            SeatError: not the steward's, a copy of an earlier one, or not possible now.
        """
        self.check(decision)
        if decision.challenge != self.challenge:
            raise SeatError(
                "that decision was taken already, or another one came first: ask again",
                Reason.AGAIN,
            )
        act = _ACTS.get(decision.act)
        if act is None:
            known = ", ".join(_ACTS)
            raise SeatError(
                f"a steward cannot {decision.act!r}; choose one of {known}", Reason.DECISION
            )
        sentence = act(self, decision)
        # One that is refused changes nothing: no driver's protest stops a steward's decision.
        self.challenge = secrets.randbits(63) | 1
        when = datetime.now(UTC).isoformat(timespec="milliseconds")
        who = decision.who or "steward"
        self.lines.append(f"{when} tick {self._session.tick} {who}: {sentence}")
        if self._log is not None:
            self._log.say("decided", sentence=sentence, by=who, tick=self._session.tick)

    def _flag(self, decision: Decision) -> str:
        self._need_race()
        try:
            flag = Flag(int(decision.value))
        except ValueError as error:
            raise SeatError(
                f"flag {decision.value:g} is unknown; 0 green, 1 yellow, 2 red", Reason.DECISION
            ) from error
        self._session.race_control.show_flag(flag)
        return f"{flag.name.lower()} flag"

    def _pause(self, _: Decision) -> str:
        self._need_race()
        self._session.race_control.pause()
        return "the clock stands"

    def _resume(self, _: Decision) -> str:
        self._session.race_control.pause(is_paused=False)
        return "the clock goes on"

    def _protest(self, decision: Decision) -> str:
        why = self._need_reason(decision)
        return self._need_court().lodge(decision.seat, decision.against, why)

    def _uphold(self, decision: Decision) -> str:
        self._check_penalty(decision.value)
        protest, seconds = decision.protest, decision.value
        return self._need_court().decide(protest, "upheld", seconds, decision.who)

    def _dismiss(self, decision: Decision) -> str:
        return self._need_court().decide(decision.protest, "dismissed", 0.0, decision.who)

    def _disqualify(self, decision: Decision) -> str:
        """Disqualify for a protest, or a seat without one."""
        court, who = self._need_court(), decision.who
        if decision.protest:
            return court.decide(decision.protest, "disqualified", 0.0, who)
        return court.disqualify(decision.seat, self._need_reason(decision), who)

    @staticmethod
    def _need_reason(decision: Decision) -> str:
        if not decision.note.strip():
            raise SeatError(f"to {decision.act} needs a reason: say why", Reason.DECISION)
        return decision.note

    def _need_court(self) -> Court:
        if self.court is None:
            raise SeatError("protests are for events: serve one with --format", Reason.DECISION)
        return self.court

    @staticmethod
    def _check_penalty(seconds: float) -> None:
        if not 0.0 < seconds <= MOST_PENALTY_S:
            raise SeatError(
                f"a penalty of {seconds:g} s: give more than 0 and at most {MOST_PENALTY_S:g} s",
                Reason.DECISION,
            )

    def _check_taken_back(self, seat: int, seconds: float) -> None:
        """Check that a seat has as many seconds of penalties.

        Raises:
            SeatError: it has fewer.
        """
        taken = 0 <= seat < len(self._session.seats)
        held_s = self._session.world.racers[0, seat].penalty_us / 1e6 if taken else 0.0
        if not 0.0 < seconds <= held_s:
            raise SeatError(
                f"{seconds:g} s of penalties taken back: seat {seat} has {held_s:g} s",
                Reason.DECISION,
            )

    def _penalty(self, decision: Decision) -> str:
        """Give a penalty; one below 0 takes as many seconds back."""
        if decision.value < 0.0:
            self._check_taken_back(decision.seat, -decision.value)
            sentence = f"{-decision.value:g} s of penalties taken back from seat {decision.seat}"
        else:
            self._check_penalty(decision.value)
            sentence = f"{decision.value:g} s penalty for seat {decision.seat}"
        if not self._session.is_on:
            driver = self._penalise_late(decision.seat, decision.value)
            return f"{sentence}, {driver}, after the race"
        driver = self._session.seat(decision.seat).driver
        self._session.race_control.penalise(decision.seat, decision.value)
        return f"{sentence}, {driver}"

    def _kick(self, decision: Decision) -> str:
        driver = self._session.seat(decision.seat).driver
        self._session.race_control.exclude(decision.seat)
        return f"seat {decision.seat}, {driver}, sent away"

    def _remove(self, decision: Decision) -> str:
        self._need_race()
        try:
            fault = Fault(int(decision.value))
        except ValueError as error:
            raise SeatError(
                f"fault {decision.value:g} is unknown; 0 to {max(Fault)}", Reason.DECISION
            ) from error
        driver = self._session.seat(decision.seat).driver
        self._session.race_control.remove(decision.seat, fault)
        why = fault.name.lower().replace("_", " ")
        return f"seat {decision.seat}, {driver}, removed from the race: {why}"

    def _close(self, decision: Decision) -> str:
        self._session.race_control.close_seat(decision.seat)
        return f"seat {decision.seat} closed"

    def _open(self, decision: Decision) -> str:
        self._session.race_control.open_seat(decision.seat)
        return f"seat {decision.seat} open"

    def _park(self, decision: Decision) -> str:
        """Have one vehicle parked, or all that drive: each in the slot that it has."""
        self._need_race()
        if not decision.value.is_integer():
            raise SeatError(f"slot {decision.value:g} is no number of a slot", Reason.DECISION)
        slot = int(decision.value)
        if decision.seat >= 0:
            self._park_seat(decision.seat, slot)
            return f"seat {decision.seat} parks" + f" in slot {slot}" * (slot >= 0)
        told, refused = list[int](), list[str]()
        for seat in self._session.seats.taken():
            try:
                self._park_seat(seat.number, ITS_OWN)
                told.append(seat.number)
            except SeatError as error:
                refused.append(f"not seat {seat.number}: {error}")
        if refused and not told:
            raise SeatError("; ".join(refused), Reason.DECISION)
        return "; ".join((f"seats {', '.join(map(str, told))} park", *refused))

    def _use(self, decision: Decision) -> str:
        self._need_race()
        self._session.race_control.use_item(decision.seat)
        return f"item of seat {decision.seat} used"

    def _restart(self, _: Decision) -> str:
        self._need_race()
        self.wants_restart = True
        return "the race starts again"

    def _need_race(self) -> None:
        if not self._session.is_on:
            phase = self._session.phase.name.lower()
            raise SeatError(f"no race is on: the session is in phase {phase}", Reason.DECISION)


_ACTS: dict[str, Callable[[Steward, Decision], str]] = {
    "flag": Steward._flag,
    "pause": Steward._pause,
    "resume": Steward._resume,
    "penalty": Steward._penalty,
    "kick": Steward._kick,
    "remove": Steward._remove,
    "close": Steward._close,
    "open": Steward._open,
    "restart": Steward._restart,
    "park": Steward._park,
    "use": Steward._use,
    "protest": Steward._protest,
    "uphold": Steward._uphold,
    "dismiss": Steward._dismiss,
    "disqualify": Steward._disqualify,
}
