"""What a spectator knows of a race, from messages alone."""

from dataclasses import replace

import pytest

from race_server.core.messages import Event, EventKind, Phase
from race_server.live.client.race_view import BACK_TICKS, RaceView, Update
from race_server.live.server.publisher import snapshot_of
from race_server.net.wire import topics
from race_server.net.wire.lobby import encode_course
from race_server.net.wire.programme import encode_programme
from race_server.net.wire.sheets import course_sheet
from race_server.net.wire.spectate import (
    SnapshotFrame,
    build_snapshot,
    encode_events,
    encode_standings,
)
from race_server.net.wire.topics import Topic
from race_server.scenario.race import Scenario
from race_server.session.session import Session
from support.courses import ring
from support.messages import PROGRAMME, STANDINGS

EVENTS = tuple(Event(number, number, EventKind.LAP, 0, 1, 1) for number in (1, 2))


@pytest.fixture(scope="module")
def frame() -> SnapshotFrame:
    return replace(snapshot_of(Session("race", Scenario(ring(), karts=1))), epoch=1, tick=600)


def receive_snapshot(view: RaceView, frame: SnapshotFrame, now_s: float = 0.0) -> Update | None:
    return view.receive(topics.SNAPSHOT, build_snapshot(frame), now_s)


def test_the_first_race_that_is_seen_is_no_other_race(frame: SnapshotFrame) -> None:
    view = RaceView(100)
    assert receive_snapshot(view, frame) == Update()
    assert (view.epoch, view.snapshot and view.snapshot.tick) == (1, 600)


def test_recent_events_and_the_stream_overlap_in_either_order() -> None:
    view = RaceView(100)
    assert view.receive(topics.EVENTS, encode_events(1, EVENTS[1:]), 0.0) == Update(
        events=EVENTS[1:]
    )
    assert view.receive(topics.RECENT, encode_events(1, EVENTS), 0.0) == Update(events=EVENTS[:1])
    assert view.events.recent() == list(EVENTS)


def test_events_of_the_next_race_count_although_their_numbers_begin_again() -> None:
    view = RaceView(100)
    view.receive(topics.EVENTS, encode_events(1, EVENTS), 0.0)
    update = view.receive(topics.EVENTS, encode_events(2, EVENTS[:1]), 0.0)
    assert update == Update(is_other_race=True, events=EVENTS[:1])
    assert view.events.recent() == [EVENTS[0]]


def test_ticks_that_go_far_back_are_those_of_a_server_that_was_started_again(
    frame: SnapshotFrame,
) -> None:
    view = RaceView(100)
    receive_snapshot(view, frame)
    view.receive(topics.EVENTS, encode_events(1, EVENTS), 0.0)
    assert receive_snapshot(view, replace(frame, tick=600 - BACK_TICKS)) == Update()
    assert receive_snapshot(view, replace(frame, tick=0)) == Update(is_other_race=True)
    assert view.events.recent() == []


def test_a_snapshot_of_another_phase_is_told(frame: SnapshotFrame) -> None:
    view = RaceView(100)
    receive_snapshot(view, frame)
    over = replace(frame, tick=601, phase=Phase.FINISHED)
    assert receive_snapshot(view, over) == Update(is_other_phase=True)
    assert receive_snapshot(view, replace(over, tick=602)) == Update()


def receive_standings(view: RaceView, topic: Topic, phase: Phase, now_s: float) -> Update | None:
    return view.receive(topic, encode_standings(replace(STANDINGS, phase=phase)), now_s)


def test_an_event_is_over_for_spectators_once_its_server_tells_of_none() -> None:
    view = RaceView(100)
    view.receive(topics.PROGRAMME, encode_programme(PROGRAMME), 0.0)
    for now_s in (0.5, 1.0, 1.5):
        assert receive_standings(view, topics.STANDINGS, Phase.RUNNING, now_s) == Update()
    assert view.programme == PROGRAMME
    over = receive_standings(view, topics.STANDINGS, Phase.RUNNING, 4.0)
    assert over == Update(is_event_over=True)
    assert view.programme is None


def test_an_event_goes_on_after_a_gap_in_the_network_and_while_its_race_is_interrupted() -> None:
    view = RaceView(100)
    view.receive(topics.PROGRAMME, encode_programme(PROGRAMME), 0.0)
    receive_standings(view, topics.STANDINGS, Phase.RUNNING, 60.0)
    for now_s in (62.0, 64.0, 66.0):
        receive_standings(view, topics.TABLE, Phase.RUNNING, now_s)
    assert view.programme == PROGRAMME


def test_the_lobby_of_a_server_without_an_event_ends_the_one_before() -> None:
    view = RaceView(100)
    view.receive(topics.PROGRAMME, encode_programme(PROGRAMME), 0.0)
    receive_standings(view, topics.TABLE, Phase.LOBBY, 6.0)
    over = receive_standings(view, topics.TABLE, Phase.LOBBY, 7.5)
    assert over == Update(is_event_over=True)


def test_the_age_of_the_snapshot_counts_from_the_quickest_one(frame: SnapshotFrame) -> None:
    view = RaceView(100)
    assert view.age_s(50.0) is None
    receive_snapshot(view, replace(frame, monotonic_us=10_000_000), 50.0)
    assert view.age_s(50.25) == pytest.approx(0.25)


def test_the_clock_of_a_server_is_unknown_before_its_first_snapshot_and_kept_over_its_races(
    frame: SnapshotFrame,
) -> None:
    view = RaceView(100)
    assert view.server_s(50.0) is None
    receive_snapshot(view, replace(frame, monotonic_us=10_000_000), 50.0)
    view.receive(topics.EVENTS, encode_events(2, EVENTS), 50.0)  # another race, none on the track
    assert view.snapshot is None
    assert view.server_s(60.0) == 20.0
    later = replace(frame, epoch=2, monotonic_us=20_500_000)  # half a second on the way
    receive_snapshot(view, later, 61.0)
    assert view.server_s(61.0) == 21.0


def test_another_server_has_a_clock_of_its_own(frame: SnapshotFrame) -> None:
    view = RaceView(100)
    receive_snapshot(view, replace(frame, monotonic_us=1_000_000_000), 50.0)
    receive_snapshot(view, replace(frame, epoch=2, monotonic_us=10_000_000), 60.0)
    assert view.server_s(60.0) == 10.0


def test_damaged_messages_are_counted_and_change_nothing(frame: SnapshotFrame) -> None:
    view = RaceView(100)
    assert view.receive(topics.SNAPSHOT, build_snapshot(frame)[:-4], 0.0) is None
    assert (view.damaged, view.snapshot) == (1, None)


def test_the_course_is_remembered() -> None:
    view = RaceView(100)
    sheet = course_sheet(Scenario(ring(), karts=1))
    assert view.receive(topics.COURSE, encode_course(sheet), 0.0) == Update()
    assert view.course is not None
    assert view.course.name == "ring"
