"""A seat as its driver holds it: take it, get ready, receive, answer, ask for it again, leave."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeVar

from race_server.core.messages import Control
from race_server.core.observation import Layout, layout_of
from race_server.credentials import badge_of
from race_server.errors import LinkError, WireError
from race_server.net.transport import ClientLink, Mailbox
from race_server.net.wire import topics
from race_server.net.wire.drive import (
    ControlFrame,
    ObservationFrame,
    decode_observation,
    encode_control,
)
from race_server.net.wire.lobby import (
    Join,
    SeatAct,
    Welcome,
    check_reply,
    decode_welcome,
    encode_join,
    encode_seat_act,
    new_serial,
)
from race_server.net.wire.parking import OrderFrame, decode_order

Answer = TypeVar("Answer")


@dataclass
class ClientSeat:
    """A seat that a driver holds."""

    welcome: Welcome
    mailbox: Mailbox
    link: ClientLink
    request: Join  # asks for this same seat again
    send: Callable[[bytes], None]  # a control, as a message; of a real kart a pose
    orders: Mailbox = field(default_factory=Mailbox)  # to park, given in mid-race

    @property
    def number(self) -> int:
        """The seat's number."""
        return self.welcome.briefing.seat

    @cached_property
    def layout(self) -> Layout:
        """Where each part of this seat's observation lies."""
        return layout_of(self.welcome.briefing.preset, self.welcome.lidar_rays)

    def receive(self, timeout_s: float) -> ObservationFrame | None:
        """Return the newest observation, None where none arrives whole within `timeout_s`.

        Raises:
            WireError: it has another size than was agreed on.
        """
        data = self.mailbox.take(timeout_s)
        try:
            frame = decode_observation(data) if data is not None else None
        except WireError:
            return None  # the next one comes in 50 ms
        if frame is not None and len(frame.values) != self.layout.size:
            raise WireError(
                f"observation of {len(frame.values)} numbers, expected {self.layout.size}: "
                "server and client are of different versions"
            )
        return frame

    def receive_order(self) -> OrderFrame | None:
        """Return the newest order to park, None where none has come."""
        data = self.orders.take(0.0)
        try:
            return decode_order(data) if data is not None else None
        except WireError:
            return None  # it is sent again

    def answer(self, epoch: int, sequence: int, tick: int, control: Control) -> None:
        """Send a control that answers the observation of a tick."""
        self.send(encode_control(ControlFrame(epoch, sequence, tick, _within(control))))

    def sender(self, topic: topics.Topic) -> Callable[[bytes], None]:
        """Return a function that sends messages of another topic of this seat."""
        return self.link.sender(self.number, badge_of(self.welcome.secret), topic)

    def act(self, topic: topics.Topic, *, ready: bool = True) -> None:
        """Report to the server that this seat is ready, or leaves.

        Raises:
            SeatError: the server refuses, with its reason.
            LinkError: no answer.
        """
        request = SeatAct(self.number, self.welcome.secret, ready)
        check_reply(self.link.ask(topic, encode_seat_act(request), self.number))

    def ask_again(self) -> Welcome:
        """Ask for the seat again and return the welcome as it is now.

        Raises:
            SeatError: the seat is no longer this driver's.
            LinkError: no answer; zenoh goes on trying to connect.
        """
        request = replace(self.request, serial=new_serial())
        return decode_welcome(self.link.ask(topics.JOIN, encode_join(request), self.number))


def take_seat(
    link: ClientLink, join: Join, mailbox: Mailbox | None = None, orders: Mailbox | None = None
) -> ClientSeat:
    """Return a seat in the session; the same request again gives the same seat.

    mailbox, orders: of the same seat on another link, which then receives from both.

    Raises:
        SeatError: the server refuses, with its reason.
        LinkError: no answer.
    """
    join = replace(join, serial=new_serial())
    welcome = decode_welcome(link.ask(topics.JOIN, encode_join(join), join.wanted))
    number = welcome.briefing.seat
    request = replace(join, wanted=number, secret=welcome.secret)
    badge = badge_of(welcome.secret)
    topic = topics.POSE if join.tracked else topics.CONTROL
    seat = ClientSeat(
        *(welcome, mailbox or Mailbox(), link, request),
        *(link.sender(number, badge, topic), orders or Mailbox()),
    )
    link.listen(topics.OBSERVATION, seat.mailbox.put, number)
    link.listen(topics.ORDER, seat.orders.put, number)
    link.announce(number, badge)
    return seat


def insist(ask: Callable[[], Answer], deadline: float) -> Answer:
    """Ask until there is an answer: a server that is still starting does not answer yet.

    Raises:
        LinkError: no answer until the deadline, a time of `time.monotonic`.
    """
    while True:
        try:
            return ask()
        except LinkError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.1)


def _within(control: Control) -> Control:
    """Return a control within its limits, so that the server accepts it."""
    return Control(
        min(max(float(control.steering), -1.0), 1.0),
        min(max(float(control.throttle), -1.0), 1.0),
        min(max(float(control.brake), 0.0), 1.0),
        control.buttons,
    )
