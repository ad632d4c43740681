"""The message that tells how an event goes."""

from dataclasses import replace

from race_server.core.bounds import MOST_ROUNDS
from race_server.net.wire import programme
from support.messages import PROGRAMME


def test_an_event_comes_back_as_it_was_sent() -> None:
    assert programme.decode_programme(programme.encode_programme(PROGRAMME)) == PROGRAMME


def test_all_attempts_that_a_driver_may_have_are_told() -> None:
    team = replace(PROGRAMME.teams[0], attempts_us=tuple(range(1, MOST_ROUNDS + 1)))
    frame = replace(PROGRAMME, teams=(team,))
    assert programme.decode_programme(programme.encode_programme(frame)) == frame


def test_of_an_event_that_is_too_large_for_a_message_the_newest_rows_come() -> None:
    laps = tuple(
        programme.DeletedLap(1 + lap // 16, 1 + lap % 16, "touched a border, left the course")
        for lap in range(64)
    )
    (team,) = PROGRAMME.teams[:1]
    protest = programme.ProtestRow(1, "Heat", team.name, team.name, "cut", "")
    teams = tuple(replace(team, seat=seat, deleted=laps) for seat in range(64))
    protests = tuple(replace(protest, number=number) for number in range(1, 65))
    data = programme.encode_programme(replace(PROGRAMME, teams=teams, protests=protests))
    back = programme.decode_programme(data)
    assert [row.seat for row in back.teams] == list(range(64))
    kept = len(back.protests)
    assert 8 <= kept < 64
    assert back.protests == protests[-kept:]
    assert all(row.deleted == laps[-kept:] for row in back.teams)
