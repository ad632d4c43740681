"""Stints: what a kart drives from one stop to the next."""

from race_server.core.messages import Event, EventKind
from race_server.core.stint import MOST_STINTS, Stint
from race_server.session.stints import Stints


def event(kind: EventKind, kart: int = 3, value: int = 0) -> Event:
    return Event(1, 0, kind, kart, 0, value)


def test_a_stint_ends_where_a_kart_is_rescued_and_says_what_it_used() -> None:
    use, other = event(EventKind.USE), event(EventKind.USE, kart=4)
    first, second, third = (event(EventKind.LAP, value=us) for us in (9, 8, 12))
    stints = Stints()
    stints.add([first, use, second, other, event(EventKind.STUCK), event(EventKind.RESCUED)])
    stints.add([third, use, use])
    assert stints.of(3) == (Stint(1, 2, 8, 1), Stint(3, 1, 12, 2))
    assert stints.of(4) == (Stint(1, 0, 0, 1),)


def test_of_many_stints_the_newest_sixteen_are_told() -> None:
    stints = Stints()
    stints.add([event(EventKind.LAP, value=7), event(EventKind.RESCUED)] * 20)
    told = stints.of(3)
    assert len(told) == MOST_STINTS == 16
    assert told[-2:] == (Stint(20, 1, 7, 0), Stint(21, 0, 0, 0))
