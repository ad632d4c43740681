"""Waiting for drivers while stewards close seats."""

from types import SimpleNamespace
from typing import Any

from race_server.live.server.lobby import Lobby
from race_server.live.server.timing import ServerTiming
from race_server.session.session import Session
from support.sessions import session_on_ring


class Waited:
    """A lobby of a session with two seats, which polls at most five times."""

    def __init__(self) -> None:
        self.session: Session = session_on_ring("lobby", 2)
        self.polls = 0
        self.said: list[dict[str, Any]] = []
        link: Any = SimpleNamespace(wait=lambda _: None)
        log: Any = SimpleNamespace(say=lambda event, **facts: self.said.append(facts))
        none: Any = (None, None)
        self.lobby = Lobby(self.session, link, none, ServerTiming(), self.poll, log)

    def poll(self) -> bool:
        self.polls += 1
        return self.polls <= 5

    def take(self, seat: int) -> None:
        self.session.seats[seat].assign("Anna", "lidar", 1, is_tracked=False)
        self.session.seats[seat].is_ready = True

    def is_over(self, drivers: int) -> bool:
        """Return whether that many drivers are there before the last poll."""
        self.polls = 0
        self.lobby.wait_for(drivers)
        return self.polls <= 5


def test_a_seat_that_is_closed_is_not_awaited() -> None:
    waited = Waited()
    waited.take(0)
    assert not waited.is_over(2)
    waited.session.race_control.close_seat(1)
    assert waited.is_over(2)


def test_a_seat_whose_driver_was_sent_away_is_not_awaited() -> None:
    waited = Waited()
    waited.take(0)
    waited.take(1)
    waited.session.race_control.exclude(1)
    assert waited.is_over(2)


def test_a_driver_that_keeps_its_closed_seat_is_awaited() -> None:
    waited = Waited()
    waited.take(0)
    waited.take(1)
    waited.session.race_control.close_seat(1)
    waited.session.seats[1].is_ready = False
    assert not waited.is_over(2)


def test_where_all_seats_are_closed_a_race_does_not_start_without_drivers() -> None:
    waited = Waited()
    for seat in (0, 1):
        waited.session.race_control.close_seat(seat)
    assert not waited.is_over(2)
    assert waited.said == [{"missing": 1, "closed": "0, 1"}]


def test_what_is_missing_is_said_once_for_each_change_of_closed_seats() -> None:
    waited = Waited()
    assert not waited.is_over(2)
    assert waited.said == []
    waited.session.race_control.close_seat(1)
    assert not waited.is_over(2)
    assert waited.said == [{"missing": 1, "closed": "1"}]
