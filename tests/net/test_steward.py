"""What the steward decides, before, in and after a race."""

import time
from dataclasses import replace
from pathlib import Path
from typing import cast

import pytest

from race_server.competition.launch import free_address
from race_server.competition.race_day.incidents import Incidents
from race_server.competition.race_day.record import record_of
from race_server.core.messages import Event, EventKind, Fault, Phase
from race_server.errors import SeatError, WireError
from race_server.live.client.steward import StewardClient
from race_server.live.server import LOCKSTEP, REAL, RaceResult, RaceServer
from race_server.live.server.steward import Steward
from race_server.net.transport import ClientLink, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.admin import (
    Decision,
    decode_decision,
    decode_log,
    encode_decision,
    encode_log,
)
from race_server.net.wire.lobby import encode_reply
from race_server.net.wire.spectate import decode_events
from race_server.session.interventions import Intervention, InterventionKind
from race_server.session.session import Session
from race_server.storage.results.keeper import Keeper
from race_server.storage.results.queries import races
from race_server.storage.results.store import Store
from race_server.storage.results.writer import Writer
from support.servers import running, wait_until, waiting
from support.sessions import session_on_ring


def racing(karts: int = 2) -> Session:
    session = session_on_ring("cup", karts, laps=1)
    for seat in range(karts):
        session.join(f"driver {seat}", "track", wanted=seat, secret=seat + 1)
    session.start()
    return session


def told(steward: Steward, act: str, seat: int = -1, value: float = 0.0) -> None:
    steward.decide(Decision("token", act, seat, value, steward.challenge, "ann"))


def test_nobody_is_steward_without_the_token() -> None:
    for token, shown in (("token", "guess"), ("token", ""), ("", "")):
        steward = Steward(racing(), token)
        with pytest.raises(SeatError, match="only the steward may do that"):
            steward.decide(Decision(shown, "flag", challenge=steward.challenge))


def test_a_decision_counts_once() -> None:
    steward = Steward(racing(), "token")
    decision = Decision("token", "penalty", 1, 5.0, steward.challenge)
    steward.decide(decision)
    with pytest.raises(SeatError, match="taken already"):
        steward.decide(decision)
    assert len(steward.lines) == 1


def test_a_decision_that_is_refused_comes_before_no_other() -> None:
    steward = Steward(racing(), "token")
    flag = Decision("token", "flag", value=1.0, challenge=steward.challenge)
    with pytest.raises(SeatError, match="protests are for events"):
        steward.decide(Decision("token", "protest", 1, challenge=steward.challenge, note="cut"))
    steward.decide(flag)
    assert steward.lines[-1].endswith("yellow flag")


class CrossedLink:
    """Takes requests to a steward; another decision comes before each of the first few."""

    def __init__(self, steward: Steward, others: int) -> None:
        self._steward, self._others = steward, others

    def ask(self, topic: topics.Topic, payload: bytes) -> bytes:
        steward = self._steward
        if topic is topics.ACTS:
            return encode_log(steward.challenge, list(steward.lines))
        if self._others:
            self._others -= 1
            told(steward, "flag", value=1.0)
        try:
            steward.decide(decode_decision(payload))
        except SeatError as error:
            return encode_reply(str(error))
        return encode_reply("")


def test_a_decision_is_sent_again_where_others_came_first_and_counts_once() -> None:
    session = racing()
    steward = Steward(session, "token")
    client = StewardClient(cast("ClientLink", CrossedLink(steward, others=3)), "token")
    assert client.decide("penalty", seat=1, value=2.0).endswith("driver 1")
    assert session.world.racers[0, 1].penalty_us == 2_000_000
    with pytest.raises(SeatError, match="seat 7 is not taken"):
        client.decide("penalty", seat=7, value=2.0)
    crowded = StewardClient(cast("ClientLink", CrossedLink(steward, others=99)), "token")
    with pytest.raises(SeatError, match="another one came first"):
        crowded.decide("penalty", seat=1, value=2.0)


def test_a_penalty_is_added_and_logged_as_an_act() -> None:
    session = racing()
    session.journal.is_recorded = True
    told(Steward(session, "token"), "penalty", 1, 2.5)
    assert session.world.racers[0, 1].penalty_us == 2_500_000
    acts = [act for act in session.journal.entries if isinstance(act, Intervention)]
    assert [(act.kart, act.value) for act in acts] == [(1, 2.5)]


def test_a_penalty_is_taken_back_as_far_as_it_was_given() -> None:
    session = racing()
    session.journal.is_recorded = True
    steward, racer = Steward(session, "token"), session.world.racers[0, 1]
    for _ in range(2):
        told(steward, "penalty", 1, 2.5)
    told(steward, "penalty", 1, -2.5)
    assert (racer.penalty_us, racer.penalties) == (2_500_000, 1)
    told(steward, "penalty", 1, -1.0)
    assert (racer.penalty_us, racer.penalties) == (1_500_000, 1)
    told(steward, "penalty", 1, -1.5)
    assert (racer.penalty_us, racer.penalties) == (0, 0)
    told(steward, "penalty", 1, 2.5)
    for seat, seconds in ((1, -3.0), (0, -1.0), (9, -1.0)):
        with pytest.raises(SeatError, match=f"taken back: seat {seat} has"):
            told(steward, "penalty", seat, seconds)
    acts = [act for act in session.journal.entries if isinstance(act, Intervention)]
    assert [act.value for act in acts] == [2.5, 2.5, -2.5, -1.0, -1.5, 2.5]
    incidents = Incidents()
    incidents.record_events(session.advance(3))
    assert incidents.stewards_us(1) == 2_500_000
    assert incidents._punished[1][1:3] == ["+2.5 s penalty", "-2.5 s penalty taken back"]


def test_a_kart_is_removed_for_a_reason_as_an_act_and_its_driver_stays() -> None:
    session = racing()
    session.journal.is_recorded = True
    steward, incidents = Steward(session, "token"), Incidents()
    told(steward, "remove", 1, float(Fault.RAMMING))
    assert steward.lines[-1].endswith("ann: seat 1, driver 1, removed from the race: ramming")
    acts = [act for act in session.journal.entries if isinstance(act, Intervention)]
    assert [(act.kind, act.kart, act.value) for act in acts] == [
        (InterventionKind.REMOVE, 1, Fault.RAMMING)
    ]
    incidents.record_events(session.advance(3))
    result = record_of(session, {0: "Anna", 1: "Bert"}, incidents).drives[1]
    assert (result.place, result.remark) == (0, "removed by the stewards: rammed others, lap 1")
    assert session.seats[1].is_present
    with pytest.raises(SeatError, match="the kart of seat 1 is in no race"):
        told(steward, "remove", 1)


def test_who_was_sent_away_comes_back_only_when_the_seat_is_opened() -> None:
    session = racing()
    steward = Steward(session, "token")
    told(steward, "kick", 1)
    with pytest.raises(SeatError, match="seat 1 is closed: the steward sent its driver away"):
        session.join("driver 1", "track", wanted=1, secret=2)
    session.reopen()
    told(steward, "open", 1)
    assert session.join("driver 1", "track", wanted=1, secret=2).number == 1


def test_a_closed_seat_is_not_given_away() -> None:
    session = session_on_ring("cup", karts=2)
    told(Steward(session, "token"), "close", 0)
    assert session.join("first", "track").number == 1
    with pytest.raises(SeatError, match="all 2 seats are taken or closed"):
        session.join("second", "track")


def test_what_makes_no_sense_is_said() -> None:
    steward = Steward(session_on_ring("cup", karts=2), "token")
    for act, message in (
        ("flag", "no race is on"),
        ("dance", "cannot 'dance'; choose one of flag"),
    ):
        with pytest.raises(SeatError, match=message):
            told(steward, act)


def test_who_owns_a_seat_takes_it_up_once_its_old_link_is_gone() -> None:
    session = racing()
    with pytest.raises(SeatError, match="a client is logged in with its keys already"):
        session.join("again", "track", wanted=1, secret=99, owns=True)
    session.drop(1)
    with pytest.raises(SeatError, match="the race has begun"):
        session.join("stranger", "track", wanted=1, secret=99)
    assert session.join("again", "track", wanted=1, secret=99, owns=True).number == 1
    assert session.seats[1].fits(99)


def test_a_stewards_messages_survive_the_wire() -> None:
    decision = Decision("token", "penalty", 3, 2.5, 1 << 62, "ann")
    assert decode_decision(encode_decision(decision)) == decision
    assert decode_log(encode_log(5, ["one", "two"])) == (5, ["one", "two"])
    with pytest.raises(WireError):
        decode_decision(encode_decision(replace(decision, value=float("nan"))))


def test_a_reason_of_more_than_120_characters_is_refused_and_not_cut() -> None:
    longest = Decision("token", "protest", 1, against=0, note="🏎" * 120)
    assert decode_decision(encode_decision(longest)) == longest
    with pytest.raises(SeatError, match="the reason has 121 characters: give at most 120"):
        encode_decision(replace(longest, note="x" * 121))


def test_of_a_log_that_is_too_long_for_a_message_the_newest_lines_are_sent() -> None:
    lines = [f"{number} {'🏎' * 250}" for number in range(500)]
    for shift in range(4):  # bytes to the next multiple of four
        longer = [line + "x" * shift for line in lines]
        message = encode_log(5, longer)
        sent = decode_log(message)[1]
        assert sent == longer[-len(sent) :]
        # A line has 4 + 1000 bytes of text and up to 16 more; the message holds 262144.
        assert 256 <= len(sent) <= 261
        assert len(message) <= 262_144


@pytest.mark.live
def test_a_penalty_after_the_finish_changes_order_result_file_and_is_announced(
    tmp_path: Path,
) -> None:
    address, path = free_address(), tmp_path / "results.sqlite"
    session = session_on_ring("cup", karts=2, laps=1, countdown_s=0.1, items=False)
    amended: list[RaceResult] = []
    heard: list[Event] = []
    with (
        Writer(Store(path), print) as writer,
        ServerLink(address, "cup", 2) as link,
        ClientLink(address, "cup") as steward,
    ):
        steward.listen(topics.EVENTS, lambda data: heard.extend(decode_events(data)[1]))
        drivers = ("pure_pursuit", "follow_gap")
        server = RaceServer(
            session,
            link,
            LOCKSTEP,
            drivers,
            Keeper(writer),
            token="token",
            amended=amended.append,
        )
        result = server.run(0)
        assert result is not None
        server.reopen()
        with waiting(server, drivers=2):
            winner, second = (row.seat for row in result.standings)
            line = StewardClient(steward, "token").decide("penalty", seat=winner, value=60.0)
    assert line.endswith(f"seat {winner}, {drivers[winner]}, after the race")
    (changed,) = amended
    assert [row.seat for row in changed.standings] == [second, winner]
    assert changed.standings[1].race_time_us == result.standings[0].race_time_us + 60_000_000
    assert changed.standings[0].gap_us == 0 < changed.standings[1].gap_us
    assert changed.digest == result.digest
    assert changed.events[-1].kind is EventKind.PENALTY
    assert changed.events[-1] in heard
    (race,) = races(path)
    assert [row["seat"] for row in race["entries"]] == [second, winner]
    assert race["entries"][1]["penalty_us"] == 60_000_000


def test_once_the_next_race_begins_a_result_stands() -> None:
    session = racing()
    session.phase = Phase.LOBBY
    with pytest.raises(SeatError, match="no race is on"):
        told(Steward(session, "token"), "penalty", 1, 5.0)


@pytest.mark.live
def test_the_steward_stops_the_clock_and_starts_the_race_anew() -> None:
    session = session_on_ring("cup", karts=1, laps=1, limit_s=30.0)
    address = free_address()
    with ServerLink(address, "cup", 1) as link:
        server = RaceServer(session, link, REAL, ("pure_pursuit",), token="token")
        with running(server), ClientLink(address, "cup") as client:
            marshal = StewardClient(client, "token")
            wait_until(lambda: session.tick > 5)
            marshal.decide("pause")
            tick = session.tick
            time.sleep(0.2)
            assert session.tick == tick
            marshal.decide("resume")
            wait_until(lambda: session.tick > tick)
            marshal.decide("restart")
            wait_until(lambda: session.epoch == 2)
            assert session.seats[0].is_taken
