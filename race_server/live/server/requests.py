"""Answers to requests, and whose link is there."""

import time
from collections.abc import Callable, Container, Iterable

from race_server.core.messages import Event, Phase
from race_server.core.rules.items import items
from race_server.credentials import key_of
from race_server.errors import Reason, SeatError, WireError
from race_server.live.local_drivers import briefing_for
from race_server.live.server.counters import Refusals
from race_server.live.server.lot import order_frame_of
from race_server.live.server.publisher import standings_of
from race_server.live.server.steward import Steward
from race_server.live.server.wheels import Wheels
from race_server.net.transport import Request, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.admin import decode_decision, encode_log
from race_server.net.wire.line import encode_line
from race_server.net.wire.lobby import (
    PROTOCOL,
    Welcome,
    decode_join,
    decode_seat_act,
    encode_course,
    encode_reply,
    encode_rules,
    encode_welcome,
)
from race_server.net.wire.sheets import LOCKSTEP, course_sheet, line_sheet, rules_sheet
from race_server.net.wire.spectate import encode_events, encode_standings
from race_server.session.parking import parks_from_start
from race_server.session.replay_guard import Granted
from race_server.session.seats import Seat
from race_server.session.session import Session


class RequestHandler:
    """Answers the requests of drivers and spectators."""

    def __init__(
        self,
        session: Session,
        link: ServerLink,
        steward: Steward,
        wheels: Wheels,
        refused: Refusals,
        announced: Callable[[Iterable[Event]], list[Event]],
        show_up_s: float,
    ) -> None:
        """Answer for a session.

        refused: counts what is refused; announced: returns those events that spectators may know
        of; show_up_s: a seat in the lobby is free again if its driver's link does not come.
        """
        self._session = session
        self._link = link
        self._steward, self._wheels = steward, wheels
        self._refused = refused
        self._announced = announced
        self._show_up_s = show_up_s
        self._linked: set[int] = set()  # seats whose driver's link is there
        self._expected: dict[int, float] = {}  # seats whose link is not there yet, since when
        self._revoked: set[int] = set()  # seats that are shut because their keys were revoked
        for seat in session.seats.closed:
            self._bar_if_sent_away(seat)

    def answer(self, request: Request) -> None:
        """Answer one request; what cannot be granted is answered with the reason."""
        try:
            request.answer(self._answer_to(request))
        except (WireError, SeatError) as error:
            self._refused.record(error.reason, request.seat)
            request.answer(encode_reply(str(error)))

    def receive_presence(self, seat: int, *, is_there: bool) -> None:
        """Record that the link of a seat's driver has come or gone."""
        if is_there:
            self._linked.add(seat)
            self._expected.pop(seat, None)
            if self._session.phase is not Phase.LOBBY and self._session.seats[seat].is_taken:
                self._session.come_back(seat)
        else:
            self._linked.discard(seat)
            self._session.drop(seat)

    def shut_revoked(self, local: Container[int]) -> None:
        """Send away the drivers whose keys have been revoked. local: seats of drivers in here."""
        for seat in self._link.revoked_seats() - self._revoked:
            self._revoked.add(seat)
            race_control = self._session.race_control
            if self._session.seats[seat].is_taken and seat not in local:
                race_control.exclude(seat)
            else:
                race_control.close_seat(seat)
            self._link.holders.admit(seat, self._session.seats[seat].key)

    def _bar_if_sent_away(self, seat: int) -> None:
        self._link.bar_seat(seat, is_barred=self._session.seats.is_sent_away(seat))

    def free_deserted_seats(self) -> None:
        """Free the seats in the lobby whose drivers' links have not come in time."""
        now = time.monotonic()
        for seat, joined in list(self._expected.items()):
            if now - joined > self._show_up_s:
                del self._expected[seat]
                self._session.drop(seat)

    def _answer_to(self, request: Request) -> bytes:
        session = self._session
        if request.topic is topics.JOIN:
            return self._seat_driver(request)
        if request.topic in {topics.READY, topics.LEAVE, topics.PARK}:
            return self._act_on_seat(request)
        if request.topic is topics.ACT:
            return self._decide(request.payload)
        if request.topic is topics.ACTS:
            self._steward.check(decode_decision(request.payload))
            return encode_log(self._steward.challenge, list(self._steward.lines))
        if request.topic is topics.COURSE:
            return encode_course(course_sheet(session.scenario))
        if request.topic is topics.RULES:
            rules = rules_sheet(session.scenario) | {LOCKSTEP: str(not self._link.is_real_time)}
            return encode_rules(rules, [item.name for item in items()])
        if request.topic is topics.LINE:
            return encode_line(line_sheet(session.scenario))
        if request.topic is topics.RECENT:
            return encode_events(session.epoch, self._announced(session.event_log.recent))
        return encode_standings(standings_of(session))

    def _seat_driver(self, request: Request) -> bytes:
        join, session = decode_join(request.payload), self._session
        if join.version != PROTOCOL:
            raise SeatError(
                f"the server speaks protocol {PROTOCOL}, the driver {join.version}: "
                "install the same version of race-server on both sides",
                Reason.VERSION,
            )
        wanted = _agreed(request.seat, join.wanted)
        session.replay_guard.check(key_of(join.secret), join.serial)
        seat = session.join(
            join.driver,
            join.preset,
            wanted=wanted,
            secret=join.secret,
            owns=self._link.is_open and request.seat >= 0,
            tracked=join.tracked,
        )
        self._grant(join.secret, join.serial)
        self._link.holders.admit(seat.number, seat.key)
        if session.phase is Phase.LOBBY and seat.number not in self._linked:
            self._expected[seat.number] = time.monotonic()
        return encode_welcome(self._welcome(seat, join.secret))

    def _act_on_seat(self, request: Request) -> bytes:
        act = decode_seat_act(request.payload)
        seat = self._session.seat(_agreed(request.seat, act.seat))
        if not seat.fits(act.secret):
            raise SeatError(f"seat {act.seat} is not yours: the secret does not fit", Reason.SECRET)
        self._session.replay_guard.check(key_of(act.secret), act.serial)
        self._grant(act.secret, act.serial)
        if request.topic is topics.LEAVE:
            self._session.leave(act.seat)
        elif request.topic is topics.PARK and act.ready:
            self._wheels.park(act.seat)
        elif request.topic is topics.PARK:
            self._wheels.release(act.seat)
        else:
            seat.is_ready = act.ready
        return encode_reply("")

    def _grant(self, secret: int, serial: int) -> None:
        """Record a request that is granted, so that copies of it are refused."""
        session, key = self._session, key_of(secret)
        session.replay_guard.record(key, serial)
        session.journal.add(Granted(session.tick, key, serial))

    def _decide(self, payload: bytes) -> bytes:
        decision = decode_decision(payload)
        self._steward.decide(decision)
        if 0 <= decision.seat < len(self._session.seats):
            self._link.holders.admit(decision.seat, self._session.seats[decision.seat].key)
            self._bar_if_sent_away(decision.seat)
        return encode_reply("")

    def _welcome(self, seat: Seat, secret: int) -> Welcome:
        session = self._session
        briefing = briefing_for(session, seat, waits=not self._link.is_real_time)
        order = order_frame_of(session, seat) if parks_from_start(session.world) else None
        rays, stays = session.scenario.lidar.rays, session.is_event
        return Welcome(briefing, secret, session.epoch, rays, order, stays)


def _agreed(named: int, claimed: int) -> int:
    """Return the seat that a request is for: that in its key, where that names one.

    Raises:
        SeatError: the message claims another.
    """
    if named >= 0 and claimed not in {-1, named}:
        raise SeatError(
            f"the request claims seat {claimed}, but came on the key of seat {named}",
            Reason.OTHER_SEAT,
        )
    return named if named >= 0 else claimed
