"""The parts of the gateway by themselves: what waits, who may, what is cast, what is played."""

import asyncio
import json
import os
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from race_server.competition.launch import free_address, process_group
from race_server.core import codes
from race_server.core.messages import Event, EventKind
from race_server.errors import GatewayError, KeysError, LinkError, RecordingError
from race_server.live.gateway.audience import Outbox, Viewer
from race_server.live.gateway.connection_limiter import ConnectionLimiter, network_of
from race_server.live.gateway.driver_seat import DriverSeat
from race_server.live.gateway.frames import EventFrames, RecordedEventFrames, event_frames
from race_server.live.gateway.handshake import Role, read_hello
from race_server.live.gateway.key_ring import KeyRing
from race_server.live.gateway.library import Library
from race_server.live.gateway.limits import GatewayLimits, GatewayTiming, RateLimiter
from race_server.live.gateway.live import LiveRace
from race_server.live.gateway.origins import check_origin, is_known_host
from race_server.live.gateway.page import NOT_BUILT, Page
from race_server.live.gateway.rays import RayCaster
from race_server.live.gateway.roles import Identity, ResumeTokens, Tokens
from race_server.live.gateway.settings import Settings, addresses_of, check_settings, place_of
from race_server.live.server.publisher import snapshot_of
from race_server.logs import Log
from race_server.net.wire import topics
from race_server.net.wire.line import decode_line
from race_server.net.wire.lobby import decode_course
from race_server.net.wire.sheets import course_sheet
from race_server.net.wire.spectate import (
    decode_events,
    decode_snapshot,
    decode_standings,
    encode_events,
)
from race_server.scenario.race import Scenario
from race_server.scenario.sensors import Lidar, Radar
from race_server.scenario.track.course import Obstacle
from race_server.session import Session
from race_server.storage.recording.channels import EVENTS, SNAPSHOTS, STANDINGS
from race_server.storage.recording.reader import read_lines
from race_server.storage.recording.seekable import SeekableRecording
from support.browsers import Browser
from support.courses import SMALL_RING
from support.served_race import ServedRace, gated, record_race

# Claim, resume, release


@dataclass(eq=False)
class Someone:
    """A browser that has sent nothing for some time."""

    received_at: float = 0.0
    outbox: Any = None
    why: GatewayError | None = None

    def disconnect(self, error: GatewayError) -> None:
        self.why = error


def test_who_comes_back_while_a_seat_is_asked_for_leaves_no_second_one_behind(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked, may_join = list[str](), threading.Event()

    def join(seat: DriverSeat, name: str, wanted: int) -> object:
        asked.append(name)
        assert may_join.wait(5.0)
        return SimpleNamespace(number=3)

    monkeypatch.setattr(DriverSeat, "_join", join)
    monkeypatch.setattr(DriverSeat, "_begin", lambda *_: b"briefing")

    async def play(pool: ThreadPoolExecutor) -> None:
        seat = DriverSeat(
            0, lambda _: pytest.fail("no link is needed"), lambda _: (), pool, GatewayTiming()
        )
        first, second = Someone(), Someone()
        slow = asyncio.create_task(seat.claim(first, "Ada", -1))
        await asyncio.sleep(0)
        assert seat.resume(second) is None
        quick = asyncio.create_task(seat.claim(second, "Ada", -1))
        await asyncio.sleep(0)
        may_join.set()
        with pytest.raises(GatewayError, match="another browser"):
            await slow
        assert await quick == b"briefing"
        assert (seat.driver, seat.number_of_seat) == (second, 3)

    with ThreadPoolExecutor(2) as pool:
        asyncio.run(play(pool))
    assert asked == ["Ada"]


# What waits for a browser


class SlowConnection:
    """A connection that has room for some frames, and then for none until it is read."""

    def __init__(self, room: int) -> None:
        self.room, self.taken = room, list[bytes]()
        self.is_open = True
        self.on_writable: Any = None

    @property
    def is_writable(self) -> bool:
        return len(self.taken) < self.room

    def put(self, frame: bytes) -> None:
        self.taken.append(frame)

    def read(self, room: int) -> None:
        self.room += room
        self.on_writable()


def outbox_of(connection: SlowConnection, unread_s: float = 10.0) -> Outbox:
    return Outbox(connection, GatewayLimits(), unread_s)


def test_a_slow_browser_gets_the_newest_snapshot_and_every_event() -> None:
    connection = SlowConnection(room=1)
    outbox = outbox_of(connection)
    for number in range(100):
        outbox.send_newest("snapshot", b"snapshot %d" % number)
        if number % 40 == 10:
            outbox.send_frame(b"event %d" % number)
    connection.read(room=10)
    assert connection.taken == [
        b"snapshot 0",
        b"event 10",
        b"event 50",
        b"event 90",
        b"snapshot 99",
    ]
    assert outbox.skipped == 98


def test_a_browser_for_which_too_much_waits_is_let_go() -> None:
    outbox = outbox_of(SlowConnection(room=0))
    for _ in range(GatewayLimits().waiting_messages):
        outbox.send_frame(b"event")
    outbox.check()
    outbox.send_frame(b"one more")
    with pytest.raises(GatewayError, match="more than 256 messages wait"):
        outbox.check()


def test_a_browser_that_reads_nothing_is_let_go() -> None:
    connection = SlowConnection(room=1)
    outbox = outbox_of(connection, unread_s=0.0)
    outbox.check()
    outbox.send_frame(b"event")
    time.sleep(0.001)
    with pytest.raises(GatewayError, match="has read nothing"):
        outbox.check()
    connection.read(room=1)
    outbox.check()


def test_events_are_written_once_for_all_who_want_to_know_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    written: list[int] = []

    def write(epoch: int, events: list[Event]) -> bytes:
        written.append(len(events))
        return encode_events(epoch, events)

    monkeypatch.setattr("race_server.live.gateway.frames.encode_events", write)
    events = [Event(number, number, EventKind.LAP, 0, 1, 1) for number in range(1, 2501)]
    frames, known = EventFrames(3), RecordedEventFrames(3, events)
    for event in events:
        frames.add([event])
    assert [frames.frames() for _ in range(10)] == 10 * [known.frames(2500)]
    assert sorted(written) == [452, 452, 1024, 1024, 1024, 1024]
    assert known.frames(1500) == [frames.frames()[0], *event_frames(3, events[1024:1500])]
    for _ in range(10):
        frames.add(events[:1024])
    assert len(frames.frames()) == 9


def test_late_events_reach_all_viewers_and_new_ones_in_order() -> None:
    events = [Event(number, number, EventKind.LAP, 0, 1, 1) for number in range(1, 5)]

    async def play() -> tuple[list[bytes], list[bytes]]:
        live = LiveRace(asyncio.get_running_loop(), Log(), lambda: None, 16)
        early, late = SlowConnection(100), SlowConnection(100)
        live.join(Viewer(outbox_of(early), 30.0))
        live.receive(topics.EVENTS, encode_events(1, events[2:]))
        await asyncio.sleep(0)
        live.receive(topics.RECENT, encode_events(1, events))
        await asyncio.sleep(0)
        live.join(Viewer(outbox_of(late), 30.0))
        return early.taken, late.taken

    early, late = asyncio.run(play())
    assert early[1:] == [*event_frames(1, events[2:]), *event_frames(1, events[:2])]
    assert late[1:] == event_frames(1, events)


@pytest.mark.parametrize(("rate", "shown"), [(60, 60), (45, 45), (30, 30), (20, 20), (1, 1)])
def test_a_viewer_is_shown_as_many_snapshots_a_second_as_it_wants(rate: float, shown: int) -> None:
    connection = SlowConnection(room=1000)
    viewer = Viewer(outbox_of(connection), rate)
    for tick in [*range(600, 660), *range(60)]:  # a new race begins at tick 0 again
        viewer.send_snapshot(tick, b"")
    assert len(connection.taken) == pytest.approx(2 * shown, abs=2)


@contextmanager
def entering(limiter: ConnectionLimiter) -> Iterator[Callable[[str], socket.socket]]:
    """Return what lets a connection of an address enter, and returns the end of the client."""
    with ExitStack() as stack:

        def enter(host: str) -> socket.socket:
            client, line = socket.socketpair()
            stack.enter_context(client)
            stack.enter_context(line)
            client.settimeout(0.0)
            limiter.enter(line, host)
            return client

        yield enter


def has_ended(client: socket.socket) -> bool:
    try:
        return client.recv(1) == b""
    except BlockingIOError:
        return False


def test_where_there_is_no_room_the_oldest_connection_ends() -> None:
    with entering(ConnectionLimiter(3, 2)) as enter:
        first, second, third = (enter(f"192.0.2.{number}") for number in range(3))
        assert not has_ended(first)
        fourth = enter("192.0.2.9")
        assert [has_ended(line) for line in (first, second, third, fourth)] == [True, *[False] * 3]
        fourth.close()


def test_one_network_of_ipv6_has_room_for_some_and_this_machine_for_all() -> None:
    with entering(ConnectionLimiter(1024, 2)) as enter:
        neighbours = [enter(f"2001:db8:0:7::{number}") for number in range(1, 4)]
        assert [has_ended(line) for line in neighbours] == [True, False, False]
        assert not has_ended(enter("2001:db8:0:8::1"))
        assert not any(has_ended(enter("::1")) for _ in range(5))


@pytest.mark.parametrize(
    ("host", "network"),
    [
        ("192.0.2.1", "192.0.2.1"),
        ("2001:db8:1:2:3:4:5:6", "2001:db8:1:2::/64"),
        ("fe80::1%eth0", "fe80::/64"),
        ("::ffff:192.0.2.1", "192.0.2.1"),
        ("a name", "a name"),
    ],
)
def test_an_address_counts_as_its_network(host: str, network: str) -> None:
    assert network_of(host) == network


def test_connections_leave_room_for_the_race_however_few_files_may_be_open() -> None:
    program = (
        "import resource\n"
        "from race_server.live.gateway.limits import GatewayLimits\n"
        "from race_server.live.gateway.service import room_for_connections as room\n"
        "resource.setrlimit(resource.RLIMIT_NOFILE, (256, 1024))\n"
        "print(room(GatewayLimits()), *resource.getrlimit(resource.RLIMIT_NOFILE))\n"
    )
    said = subprocess.run(
        [sys.executable, "-c", program],
        env={**os.environ, "RACE_SERVER_INTERPRET": "1"},
        capture_output=True,
        text=True,
        check=True,
    )
    assert said.stdout.split() == ["512", "1024", "1024"]


def test_an_allowance_fills_up_again() -> None:
    now = [0.0]
    limiter = RateLimiter(10.0, "texts", burst_s=2.0, clock=lambda: now[0])
    for _ in range(20):
        limiter.spend()
    with pytest.raises(GatewayError, match="more than 10 texts a second"):
        limiter.spend()
    now[0] += 0.11
    limiter.spend()


# Who may


def test_a_hello_without_words_is_that_of_a_spectator() -> None:
    hello = read_hello("{}")
    assert (hello.role, hello.source, hello.seat, hello.rate) == (Role.SPECTATE, "live", -1, 30.0)


@pytest.mark.parametrize(
    "words",
    [
        [],
        {"seat": 64},
        {"seat": True},
        {"seat": 1.5},
        {"rate": True},
        {"token": 7},
        {"source": "file"},
        {"name": "a\nb"},
    ],
)
def test_a_hello_of_the_wrong_kind_is_refused(words: object) -> None:
    with pytest.raises(GatewayError) as caught:
        read_hello(json.dumps(words))
    assert caught.value.code == "malformed"


def test_rates_beyond_the_bounds_are_moved_into_them() -> None:
    assert read_hello('{"rate": 1e9}').rate == 60.0
    with pytest.raises(GatewayError):
        read_hello('{"rate": NaN}')


def test_each_token_opens_its_own_role() -> None:
    tokens = Tokens(drive=("a", "b"), steward="c")
    assert tokens.identify(read_hello('{"role": "drive", "token": "b"}')).number == 1
    for words in ('{"role": "drive", "token": "c"}', '{"role": "steward", "token": ""}'):
        with pytest.raises(GatewayError):
            tokens.identify(read_hello(words))
    with pytest.raises(GatewayError):
        Tokens().identify(read_hello('{"role": "steward", "token": ""}'))


def test_spectators_cannot_push_out_the_words_of_drivers() -> None:
    tokens = ResumeTokens(1024)
    driver = tokens.issue(Identity(Role.DRIVE, 0))
    issued = [tokens.issue(Identity(Role.SPECTATE)) for _ in range(1100)]
    assert tokens.find(driver).number == 0
    with pytest.raises(GatewayError):
        tokens.find(issued[0])
    tokens.revoke(driver)
    with pytest.raises(GatewayError):
        tokens.find(driver)


def test_a_name_server_that_lies_does_not_make_a_page_ours() -> None:
    headers = {"origin": "http://evil.example:8080", "host": "evil.example:8080"}
    with pytest.raises(GatewayError, match="evil"):
        check_origin(headers, (), is_local=True)
    check_origin(headers, (), is_local=False)  # there people choose the name
    check_origin({"origin": "http://localhost:1", "host": "localhost:1"}, (), is_local=True)
    check_origin({"host": "localhost:1"}, (), is_local=True)
    for origin in ("null", "http://[", ""):
        with pytest.raises(GatewayError):
            check_origin({"origin": origin, "host": ""}, (), is_local=False)
    assert not is_known_host("[", ())
    assert is_known_host("[::1]:8080", ())
    assert is_known_host("race.example", ("https://race.example",))


def test_each_address_of_this_machine_is_a_name_of_our_own() -> None:
    check_origin({"origin": "http://127.0.0.2:1", "host": "127.0.0.2:1"}, (), is_local=True)
    assert is_known_host("127.0.0.2:1", ())
    assert not is_known_host("127.0.0.2.evil.example:1", ())


def test_beyond_this_machine_a_gateway_wants_a_word_and_tokens() -> None:
    settings = Settings("tcp/127.0.0.1:7447", "race", KeyRing(), host="192.0.2.1")
    with pytest.raises(LinkError, match="say so with --open"):
        check_settings(settings, is_open=False)
    with pytest.raises(KeysError, match="--spectators token"):
        check_settings(settings, is_open=True)
    closed = replace(settings, tokens=Tokens("watch"), certificate=Path("page.pem"))
    with pytest.raises(KeysError, match="come together"):
        check_settings(closed, is_open=True)
    with pytest.raises(KeysError, match="cannot be used"):
        check_settings(replace(closed, private_key=Path("nowhere.pem")), is_open=True)


def test_tokens_stand_behind_the_hash_of_an_address() -> None:
    tokens = Tokens("w", ("d",), "s")
    settings = Settings("tcp/127.0.0.1:7447", "race", KeyRing(), host="::1", tokens=tokens)
    addresses = addresses_of(settings, 8080)
    assert addresses.base == "http://[::1]:8080/"
    assert addresses.watch == "http://[::1]:8080/#watch&token=w"
    assert addresses.drive == ("http://[::1]:8080/#drive&token=d",)


@pytest.mark.parametrize("words", ["8080", "host:", "host:x", ":80", "host:70000"])
def test_a_place_that_is_none_says_how_to_write_one(words: str) -> None:
    with pytest.raises(LinkError, match="write HOST:PORT"):
        place_of(words)


# The page


def test_a_page_that_is_not_built_says_how(tmp_path: Path) -> None:
    page = Page.read(tmp_path)
    assert page.files[""].content.decode().strip() == NOT_BUILT


def test_a_page_serves_its_own_files_and_no_others(tmp_path: Path) -> None:
    (tmp_path / "assets").mkdir()
    (tmp_path / "index.html").write_text("<!doctype html>")
    (tmp_path / "assets" / "page-1a2b.js").write_text("1;" * 1000)
    (tmp_path / "secret.txt").write_text("secret")
    page = Page.read(tmp_path)
    assert set(page.files) == {"", "assets/page-1a2b.js"}
    assert page.files["assets/page-1a2b.js"].kind.startswith("text/javascript")
    assert 0 < len(page.files["assets/page-1a2b.js"].packed) < 200


def test_a_gateway_that_fails_does_not_fail_the_race() -> None:
    with process_group() as group:
        fails = group.start(["gateway", "--listen", "nowhere"], subprocess.DEVNULL, aside=True)
        assert fails.wait(20.0) == 2
        assert not group.has_failed()


# Rays


def test_rays_are_those_that_the_sensors_of_the_race_give() -> None:
    obstacle = Obstacle(x=6.2, y=1.0, heading=0.4, length=0.5, width=0.3)
    course = replace(SMALL_RING, obstacles=(obstacle,))
    lidar, radar = Lidar(noise=0.0), Radar()
    session = Session("race", Scenario(course, karts=3, seed=3, lidar=lidar, radar=radar))
    for seat in range(3):
        session.join("driver", "full", wanted=seat)
    session.start()
    hazard = session.world.hazards[0, 0]
    hazard.x, hazard.y, hazard.radius, hazard.until_tick = 5.9, -0.2, 0.2, 10**6
    session.advance(13)  # all stand on the grid, and sensors have looked
    sight, frame = session.world.sight, snapshot_of(session)
    caster = RayCaster(course_sheet(session.scenario), lidar, radar)
    seen = set[int]()
    for seat in range(3):
        rays = caster.cast(frame, seat)
        assert rays is not None
        np.testing.assert_allclose(rays.lidar, sight.lidar[0, seat, 0], atol=2e-3)
        np.testing.assert_allclose(rays.radar, sight.radar[0, seat], atol=2e-3)
        assert (rays.radar_kinds == sight.radar_kinds[0, seat]).all()
        seen |= set(rays.radar_kinds.tolist())
    assert seen >= {codes.BORDER, codes.KART_HIT}
    assert caster.cast(frame, 9) is None


# Recordings


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_race(tmp_path_factory.mktemp("recordings"))


@pytest.fixture(scope="module")
def served(recording: Path) -> Iterator[ServedRace]:
    """A gateway without a race, before a folder with one recording."""
    with gated(free_address(), recordings=recording.parent) as served:
        yield served


@pytest.mark.net
def test_a_tape_holds_what_the_recording_holds(recording: Path) -> None:
    kinds = (SNAPSHOTS, EVENTS, STANDINGS)
    lines = [line for line in read_lines(recording) if line is not None and line.kind in kinds]
    with SeekableRecording(recording) as opened:
        shown = opened.between(-1, opened.last_tick)
        assert [(m.kind, m.data) for m in shown] == [(line.kind, line.data) for line in lines]
        assert opened.is_finished()
        middle = opened.newest(SNAPSHOTS, opened.last_tick // 2)
        assert middle is not None
        assert decode_snapshot(middle.data).tick == middle.tick <= opened.last_tick // 2
        assert opened.newest(STANDINGS, -5) is None


@pytest.mark.net
def test_a_tape_that_was_cut_short_ends_with_its_last_whole_chunk(
    recording: Path, tmp_path: Path
) -> None:
    data = recording.read_bytes()
    short = tmp_path / "short.mcap"
    short.write_bytes(data[: len(data) * 2 // 3])
    with SeekableRecording(short) as opened, SeekableRecording(recording) as whole:
        assert 0 < opened.last_tick < whole.last_tick
        assert not opened.is_finished()
    for damaged in (b"", b"rubbish" * 50, data[:300]):
        short.write_bytes(damaged)
        with pytest.raises(RecordingError, match=r"short.mcap"):
            SeekableRecording(short)


@pytest.mark.net
def test_only_recordings_of_the_folder_are_listed_and_opened(
    recording: Path, tmp_path: Path
) -> None:
    inside, outside = tmp_path / "inside", tmp_path / "outside.mcap"
    inside.mkdir()
    data = recording.read_bytes()
    outside.write_bytes(data)
    (inside / "cup.mcap").write_bytes(data)
    (inside / "cup.journal.mcap").write_bytes(data)
    (inside / "rubbish.mcap").write_bytes(b"rubbish")
    (inside / "link.mcap").symlink_to(outside)
    library = Library(inside, GatewayLimits())
    assert [(title["name"], title["karts"]) for title in library.titles()] == [("cup", 3)]
    opened, events = library.open("cup")
    # The first event of a race, its countdown, comes before the recording begins.
    assert [event.sequence for event in events] == list(range(2, len(events) + 2))
    opened.close()
    names = ("../outside", "link", "cup.journal", "", ".", "cup.mcap", str(outside), "rubbish")
    for name in names:
        with pytest.raises(GatewayError) as caught:
            library.open(name)
        assert caught.value.code == "no-recording"
    assert Library(None, GatewayLimits()).titles() == []
    assert Library(tmp_path / "nowhere", GatewayLimits()).titles() == []


@pytest.mark.net
def test_a_recording_that_vanishes_while_the_list_is_made_is_left_out(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "cup.mcap").write_bytes(recording.read_bytes())
    paths = [tmp_path / "gone.mcap", *tmp_path.iterdir()]
    monkeypatch.setattr(Path, "iterdir", lambda _: iter(paths))
    monkeypatch.setattr(Path, "is_file", lambda _: True)
    library = Library(tmp_path, GatewayLimits())
    assert [title["name"] for title in library.titles()] == ["cup"]
    with pytest.raises(GatewayError, match="no recording is called"):
        library.open("gone")


@pytest.mark.net
def test_a_recording_is_played_sought_and_stepped(served: ServedRace, recording: Path) -> None:
    source = {"source": f"recording:{recording.stem}", "rate": 60}
    with Browser(served.base, source) as browser:
        assert browser.word("welcome")["session"] == "cup"
        assert decode_course(browser.frame(b"RCRS")).name == "ring"
        assert decode_line(browser.frame(b"RLIN")).lap == 0.0
        begin = browser.word("position")
        assert (begin["tick"], begin["playing"], begin["sought"]) == (0, False, True)
        last = begin["last"]
        browser.send({"type": "seek", "tick": last // 2})
        assert browser.word("position")["tick"] == last // 2
        assert decode_standings(browser.frame(b"RSTD")).tick <= last // 2
        _, events = decode_events(browser.frame(b"REVT"))
        assert events[0].sequence == 2
        assert max(event.tick for event in events) <= last // 2
        snapshot = decode_snapshot(browser.frame(b"RSNP"))
        assert 0 <= last // 2 - snapshot.tick < 3
        browser.send({"type": "step", "ticks": -30})
        assert browser.word("position")["tick"] == last // 2 - 30
        earlier = decode_snapshot(browser.frame(b"RSNP")).tick
        assert earlier < snapshot.tick
        browser.send({"type": "follow", "seat": 1, "rays": True})
        assert browser.frame(b"RRAY")
        browser.send({"type": "play", "speed": 8})
        ticks = [decode_snapshot(browser.frame(b"RSNP")).tick for _ in range(5)]
        assert ticks == sorted(ticks)
        assert ticks[0] > earlier
        browser.send({"type": "seek", "tick": last - 30})
        end = browser.until(lambda h: isinstance(h, dict) and h.get("tick") == last)
        assert not end["playing"]


@pytest.mark.net
def test_words_for_recordings_mean_nothing_to_a_live_race(served: ServedRace) -> None:
    with Browser(served.base, {"role": "spectate"}) as browser:
        browser.send({"type": "seek", "tick": 1})
        assert browser.refusal() == ("malformed", 4400)
