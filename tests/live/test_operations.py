"""What a server shows of itself, and what a client knows of what it sees."""

import io
import json
import os
import random
import socket
import threading
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from unittest.mock import Mock

import pytest

from race_server.core.clock import TICK_S
from race_server.core.messages import Control, Event, EventKind, Retirement
from race_server.errors import LinkError
from race_server.live.client.clock_offset import ClockOffset
from race_server.live.client.leaderboard import event_text
from race_server.live.client.link_stats import LinkStats
from race_server.live.server import RaceServer, ServerTiming
from race_server.live.server.counters import Counters, Histogram
from race_server.live.server.metrics import exposed
from race_server.logs import Log, words_of
from race_server.net.transport import Request, ServerLink
from race_server.net.wire import topics
from race_server.net.wire.drive import ControlFrame, encode_control
from race_server.net.wire.lobby import Join, encode_join
from race_server.tools.drills.damage import toll_of
from race_server.tools.drills.decoders import Decoder, decoders
from race_server.tools.drills.lossy_link import LinkConditions, LossyLink
from race_server.tools.drills.network import drill_network
from race_server.tools.drills.server_process import quantile
from support.sessions import session_on_ring


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def get(port: int, path: str) -> tuple[int, str]:
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        with opener.open(f"http://127.0.0.1:{port}{path}", timeout=5.0) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


@pytest.fixture
def racing() -> Iterator[RaceServer]:
    """Return a server in the middle of a race of two, one of whom is silent."""
    session = session_on_ring("test", karts=2, countdown_s=0.1)
    with ServerLink(f"tcp/127.0.0.1:{free_port()}", "test", 2) as link:
        server = RaceServer(session, link)
        for number in range(2):
            session.join(f"driver {number}", "track")
        session.start()
        for sequence in (1, 2, 5):
            frame = ControlFrame(1, sequence, session.tick, Control(throttle=0.1))
            server.inbox.receive_control(0, encode_control(frame))
            server.poll()
            server.advance(30)
            server.counters.record_tick(0.0003, 0.00001, missed=1)
        server.inbox.receive_control(0, b"rubbish")
        yield server


@pytest.mark.live
def test_metrics_are_read_as_prometheus_reads_them(racing: RaceServer) -> None:
    with exposed(racing, 0) as port:
        status, text = get(port, "/metrics")
    assert status == 200
    lines = text.splitlines()
    for line in (
        "race_ticks_total 90.0",
        "race_ticks_missed_total 1.0",
        'race_tick_duration_seconds_bucket{le="0.0005"} 3.0',
        'race_inputs_total{seat="0"} 3.0',
        'race_inputs_lost_total{seat="0"} 2.0',
        'race_silent_seconds_total{seat="1"} 1.0',
        'race_input_age_seconds{seat="0"} 0.5',
        'race_refused_total{reason="damaged"} 1.0',
        "race_recorder_backlog 0.0",
        "race_clients 0.0",
    ):
        assert line in lines
    assert 'race_input_age_seconds{seat="1"}' not in text  # it was never heard


@pytest.mark.live
def test_a_server_whose_loop_turns_is_well_and_one_that_stands_says_so(
    racing: RaceServer,
) -> None:
    with exposed(racing, 0) as port:
        racing.poll()
        assert get(port, "/healthz") == (200, "ok\n")
        racing.counters.turned_at -= 7.0
        status, text = get(port, "/healthz")
        assert status == 503
        assert text.startswith("the loop has not turned for 7.")
        assert get(port, "/")[0] == 404


@pytest.mark.live
def test_a_port_for_metrics_that_is_in_use_is_named(racing: RaceServer) -> None:
    with exposed(racing, 0) as port:
        again = exposed(racing, port)
        with pytest.raises(LinkError, match=f"port {port} .*another with --metrics"):
            again.__enter__()


def test_a_time_falls_into_the_first_bin_that_holds_it() -> None:
    histogram = Histogram((0.001, 0.002))
    for seconds in (0.0005, 0.001, 0.0015, 9.0):
        histogram.record(seconds)
    assert histogram.counts == [2, 1, 1]


def test_the_first_control_of_a_race_and_a_repeated_one_lose_nothing() -> None:
    counters = Counters(1)
    counters.record_control(0, before=0, sequence=9)
    counters.record_control(0, before=9, sequence=10)
    assert counters.lost == [0]


@pytest.mark.live
def test_a_sender_cannot_make_up_reasons_for_refusals(racing: RaceServer) -> None:
    # A backslash before the quote once made the words of the sender part of the reason.
    joins = [encode_join(Join("thief", f"{letter}\\", 0)) for letter in "abcdefgh"]
    for data in (*joins, b"x" * 5000):
        asked = Request(topics.JOIN, 0, data, [Mock()])
        racing.inbox._requests.answer(asked)
    assert racing.refusals() == {"unknown observation": 8, "damaged": 1, "oversized": 1}
    with exposed(racing, 0) as port:
        figures = get(port, "/metrics")[1].splitlines()
    assert sum(line.startswith("race_refused_total{") for line in figures) == 3


# The log


def test_outside_of_a_terminal_each_line_is_one_json_object() -> None:
    stream = io.StringIO()
    with Log(stream=stream) as log:
        log.say("joined", seat=3, driver="ann")
        log.warn("missed ticks", new=2)
    first, second = (json.loads(line) for line in stream.getvalue().splitlines())
    assert list(first)[:3] == ["timestamp", "level", "event"]
    assert (first["event"], first["seat"], first["driver"]) == ("joined", 3, "ann")
    assert second["level"] == "warning"


def test_in_a_terminal_a_line_is_readable() -> None:
    stream = io.StringIO()
    stream.isatty = lambda: True  # type: ignore[method-assign]
    Log(stream=stream).say("joined", seat=3)
    assert "joined" in stream.getvalue()
    assert not stream.getvalue().startswith("{")


def test_a_json_line_is_turned_back_into_words() -> None:
    line = '{"timestamp": "x", "level": "info", "event": "joined", "seat": 3, "driver": "ann"}'
    assert words_of(line) == "joined: seat 3, driver ann"
    assert words_of("error: no such track") == "error: no such track"


@pytest.mark.live
def test_the_diary_says_who_comes_goes_and_returns_once() -> None:
    stream = io.StringIO()
    session = session_on_ring("test", karts=2, countdown_s=0.1)
    with ServerLink(f"tcp/127.0.0.1:{free_port()}", "test", 2) as link:
        timing = ServerTiming(log_s=0.0)
        server = RaceServer(session, link, log=Log(stream=stream), timing=timing)
        steps: tuple[Callable[[], object], ...] = (
            lambda: session.join("ann", "track"),
            lambda: session.start(),
            lambda: session.drop(0),
            lambda: session.come_back(0),
            lambda: server.inbox.receive_control(0, b"rubbish"),
            lambda: server.inbox.receive_control(0, b"rubbish"),
        )
        for step in steps:
            step()
            server.poll()
    events = [json.loads(line)["event"] for line in stream.getvalue().splitlines()]
    assert events == [
        "joined",
        "race started",
        "dropped: its link is gone",
        "came back",
        "refused for the first time",
    ]


# What a client hears


def test_the_age_of_a_message_counts_from_the_quickest_one() -> None:
    offset = ClockOffset()
    offset.record(sent_s=10.0, received_s=110.2)  # held up by 0.2 s
    offset.record(sent_s=11.0, received_s=111.0)
    assert offset.age_s(11.0, 111.3) == pytest.approx(0.3)
    offset.record_round_trip(0.1)
    assert offset.age_s(11.0, 111.3) == pytest.approx(0.35)


def test_a_clock_that_drifts_is_followed() -> None:
    offset = ClockOffset()
    for second in range(120):
        offset.record(sent_s=second * 1.001, received_s=float(second))
    assert offset.offset_s == pytest.approx(-0.119, abs=1e-6)
    for second in range(120, 240):
        offset.record(sent_s=120.0 + (second - 120) * 0.999, received_s=float(second))
    assert offset.offset_s == pytest.approx(0.06, abs=0.05)


def test_a_driver_knows_what_it_missed_and_how_old_it_was() -> None:
    link_stats = LinkStats()
    for tick in (0, 3, 6, 15, 18):  # 9 and 12 never came
        link_stats.record_observation(tick, 100.0 + tick * TICK_S, decision_ticks=3)
    assert (link_stats.received, link_stats.missing) == (5, 2)
    assert link_stats.longest_gap_s == pytest.approx(9 * TICK_S)
    assert link_stats.worst_age_s == pytest.approx(9 * TICK_S)


def test_where_the_world_waits_there_are_no_ages() -> None:
    link_stats = LinkStats()
    for turn in range(5):
        link_stats.record_observation(3 * turn, 100.0 + turn, decision_ticks=3)
    assert link_stats.as_json()["worst_age_s"] is None


def test_a_driver_is_told_why_it_is_out() -> None:
    link_stats = LinkStats()
    link_stats.record_event(Event(1, 9, EventKind.RETIRED, 4, Retirement.WITHDREW, 0), seat=3)
    assert link_stats.outcome == ""
    link_stats.record_event(Event(2, 9, EventKind.RETIRED, 3, Retirement.STOPPED, 0), seat=3)
    assert link_stats.outcome == "out: stood for too long"


@pytest.mark.parametrize("reason", Retirement)
def test_every_reason_to_be_out_has_words_for_the_driver(reason: Retirement) -> None:
    link_stats = LinkStats()
    link_stats.record_event(Event(1, 9, EventKind.RETIRED, 3, reason, 0), seat=3)
    assert len(link_stats.outcome) > len("out: ")


@pytest.mark.parametrize(
    ("event", "sentence"),
    [
        (Event(1, 9, EventKind.PARKED, 1, 7, 12), "bea is parked in slot 7"),
        (Event(1, 9, EventKind.PARKED, 1, -1, 12), "bea is parked"),
        (Event(1, 9, EventKind.HIT_PERSON, 1, 0, 2500), "bea hits a person"),
        (Event(1, 9, EventKind.RETIRED, 1, Retirement.LEFT_LOT, 0), "bea is out (left lot)"),
    ],
)
def test_what_happens_in_a_car_park_is_told_on_the_terminal(event: Event, sentence: str) -> None:
    assert event_text(event, ["ada", "bea"], []) == sentence


def test_a_driver_is_told_that_it_is_parked() -> None:
    link_stats = LinkStats()
    link_stats.record_event(Event(1, 9, EventKind.PARKED, 3, 7, 12), seat=3)
    assert link_stats.outcome == "parked"


# What is damaged


@pytest.mark.parametrize("kind", decoders(), ids=lambda kind: kind.name)
def test_hostile_messages_end_in_one_kind_of_error_or_in_values_within_limits(
    kind: Decoder,
) -> None:
    kind.decode(kind.sample)
    toll = toll_of(kind, 1000, seed=3)
    assert toll.decoded == 1000
    assert set(toll.errors) == {kind.refuses.__name__}


@pytest.mark.parametrize(("share", "end"), [(0.5, 0.001), (0.9, 0.002), (1.0, float("inf"))])
def test_a_quantile_is_the_end_of_its_bin(share: float, end: float) -> None:
    before = {f't_bucket{{le="{end}"}}': 100.0 for end in ("0.001", "0.002", "+Inf")}
    after = {
        't_bucket{le="0.001"}': 106.0,
        't_bucket{le="0.002"}': 109.0,
        't_bucket{le="+Inf"}': 110.0,
    }
    assert quantile(before, after, "t", share) == end
    assert quantile(after, after, "t", share) is None


# A bad wire


def ends_of(weather: LinkConditions) -> tuple[LossyLink, socket.socket, socket.socket]:
    pairs = [socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM) for _ in range(2)]
    devices = (pairs[0][1].detach(), pairs[1][1].detach())
    return LossyLink(("a", "b"), devices, weather, random.Random(5)), pairs[0][0], pairs[1][0]


def test_a_wire_delays_every_packet_and_carries_it_to_the_other_end() -> None:
    wire, here, there = ends_of(LinkConditions(delay_s=0.05))
    thread = threading.Thread(target=wire.carry)
    thread.start()
    begun = time.monotonic()
    here.send(b"to there")
    there.send(b"to here")
    assert (there.recv(99), here.recv(99)) == (b"to there", b"to here")
    assert 0.05 <= time.monotonic() - begun < 1.0
    wire.cut()
    thread.join()
    for device in (*wire.devices, here.detach(), there.detach()):
        os.close(device)


def test_a_wire_loses_the_share_of_packets_that_it_is_told() -> None:
    wire, here, there = ends_of(LinkConditions(loss=0.2))
    for _ in range(2000):
        here.send(b"x")
        wire.receive(wire.devices[0])
    assert wire.passed + wire.lost == 2000
    assert wire.lost == pytest.approx(400, abs=60)
    for device in (*wire.devices, here.detach(), there.detach()):
        os.close(device)


def test_without_root_the_drill_of_the_network_is_skipped_with_a_word(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("os.geteuid", lambda: 1000)
    document = drill_network(LinkConditions(0.2, 0.1, 0.05))
    assert document == {"ok": True, "why": "", "skipped": "network namespaces need root"}
