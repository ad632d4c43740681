"""A seat as its driver holds it: taken, made ready, asked for again, left."""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

from race_server.errors import LinkError
from race_server.transport import ClientLink, Mailbox
from race_server.wire import topics
from race_server.wire.lobby import (
    Join,
    SeatAct,
    Welcome,
    check_reply,
    decode_welcome,
    encode_join,
    encode_seat_act,
)

Answer = TypeVar("Answer")

# Without an observation for so long the server is asked whether it is still there.
SILENCE_S = 3.0


@dataclass
class Seat:
    """What a driver holds while it takes part."""

    welcome: Welcome
    mailbox: Mailbox
    link: ClientLink
    request: Join  # asks for this very seat again

    @property
    def number(self) -> int:
        """The seat's number."""
        return self.welcome.briefing.seat

    def act(self, topic: topics.Topic, *, ready: bool = True) -> None:
        """Tell the server that this seat is ready, or leaves."""
        request = SeatAct(self.number, self.welcome.secret, ready)
        check_reply(self.link.ask(topic, encode_seat_act(request)))

    def come_back(self) -> Welcome:
        """Ask for the seat again and return the welcome as it is now.

        Raises:
            SeatError: it is no longer this driver's.
            LinkError: no answer; zenoh goes on trying to connect.
        """
        return decode_welcome(self.link.ask(topics.JOIN, encode_join(self.request)))


def take_seat(link: ClientLink, join: Join) -> Seat:
    """Return a seat in the session; the same request again gives the same seat.

    Raises:
        SeatError: the server refuses, with its reason.
        LinkError: no answer.
    """
    welcome = decode_welcome(link.ask(topics.JOIN, encode_join(join)))
    request = replace(join, wanted=welcome.briefing.seat, secret=welcome.secret)
    seat = Seat(welcome, Mailbox(), link, request)
    link.listen(topics.OBSERVATION, seat.mailbox.put, seat.number)
    link.announce(seat.number)
    return seat


def insist(ask: Callable[[], Answer], deadline: float) -> Answer:
    """Ask until there is an answer; a server that is still getting ready may take its time.

    Raises:
        LinkError: none until the deadline, a time of `time.monotonic`.
    """
    while True:
        try:
            return ask()
        except LinkError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.1)
