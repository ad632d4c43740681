"""The lobby's desk: answers requests, and keeps account of whose link is there."""

import time
from collections import Counter
from collections.abc import Callable, Iterable

from race_server.errors import SeatError, WireError
from race_server.messages import Event, Phase
from race_server.paddock import briefing_for
from race_server.rules.items import items
from race_server.server.herald import rules_of, sheet_of, standings_of
from race_server.session import Seat, Session
from race_server.transport import Request
from race_server.wire import topics
from race_server.wire.lobby import (
    Welcome,
    decode_join,
    decode_seat_act,
    encode_course,
    encode_reply,
    encode_rules,
    encode_welcome,
)
from race_server.wire.spectate import encode_events, encode_standings

# A seat is given away again if its driver's link does not show up in the lobby for so long.
SHOW_UP_S = 10.0


class Desk:
    """Answers the requests of drivers and spectators."""

    def __init__(
        self,
        session: Session,
        refused: Counter[str],
        told: Callable[[Iterable[Event]], list[Event]],
    ) -> None:
        """Serve a session.

        refused: counts what was refused, by reason; told: returns those events that everybody
        may know of.
        """
        self._session = session
        self._refused = refused
        self._told = told
        self._linked: set[int] = set()  # seats whose driver's link is there
        self._expected: dict[int, float] = {}  # seats whose link is not there yet, since when

    def answer(self, request: Request) -> None:
        """Answer one request; what cannot be granted is answered with the reason."""
        try:
            request.answer(self._answer_to(request))
        except (WireError, SeatError) as error:
            self._refused[reason_of(error)] += 1
            request.answer(encode_reply(str(error)))

    def take_presence(self, seat: int, *, is_there: bool) -> None:
        """Take note that the link of a seat's driver has come or gone."""
        if is_there:
            self._linked.add(seat)
            self._expected.pop(seat, None)
        else:
            self._linked.discard(seat)
            self._session.drop(seat)

    def free_deserted_seats(self) -> None:
        """Give seats away again that were taken by somebody who never showed up."""
        now = time.monotonic()
        for seat, joined in list(self._expected.items()):
            if now - joined > SHOW_UP_S:
                del self._expected[seat]
                self._session.drop(seat)

    def _answer_to(self, request: Request) -> bytes:
        session = self._session
        if request.topic is topics.JOIN:
            return self._seat_driver(request.payload)
        if request.topic in {topics.READY, topics.LEAVE}:
            return self._act_on_seat(request)
        if request.topic is topics.COURSE:
            return encode_course(sheet_of(session))
        if request.topic is topics.RULES:
            return encode_rules(rules_of(session), [item.name for item in items()])
        if request.topic is topics.RECENT:
            return encode_events(session.epoch, self._told(session.recent))
        return encode_standings(standings_of(session))

    def _seat_driver(self, payload: bytes) -> bytes:
        join, session = decode_join(payload), self._session
        seat = session.join(
            join.driver,
            join.preset,
            wanted=join.wanted,
            secret=join.secret,
            tracked=join.tracked,
        )
        if session.phase is Phase.LOBBY and seat.number not in self._linked:
            self._expected[seat.number] = time.monotonic()
        return encode_welcome(self._welcome(seat))

    def _act_on_seat(self, request: Request) -> bytes:
        act = decode_seat_act(request.payload)
        seat = self._session.seat(act.seat)
        if act.secret != seat.secret:
            raise SeatError(f"seat {act.seat} is not yours: the secret does not fit")
        if request.topic is topics.LEAVE:
            self._session.leave(act.seat)
        else:
            seat.is_ready = act.ready
        return encode_reply("")

    def _welcome(self, seat: Seat) -> Welcome:
        session = self._session
        briefing = briefing_for(session, seat)
        return Welcome(briefing, seat.secret, session.epoch, session.scenario.lidar.rays)


def reason_of(error: Exception) -> str:
    """Return what kind of refusal an error is, without the numbers that differ each time."""
    words = str(error).split(":", 1)[0]
    return " ".join(word for word in words.split() if not any(c.isdigit() for c in word))[:60]
