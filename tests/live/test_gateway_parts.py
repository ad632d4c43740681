"""The parts of the gateway by themselves: what waits, who comes back, what is cast, the page."""

import asyncio
import subprocess
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Self, cast

import numpy as np
import pytest

from race_server.competition.launch import process_group
from race_server.core import codes
from race_server.core.messages import Event, EventKind
from race_server.errors import GatewayError
from race_server.live.gateway.audience import Outbox, Viewer
from race_server.live.gateway.driver_seat import DriverSeat
from race_server.live.gateway.frames import (
    EventFrames,
    RecordedEventFrames,
    event_frames,
    frame_of,
    notice_frame,
)
from race_server.live.gateway.limits import GatewayLimits, GatewayTiming
from race_server.live.gateway.listener import Listener
from race_server.live.gateway.live import LiveRace
from race_server.live.gateway.page import NOT_BUILT, Page
from race_server.live.gateway.rays import RayCaster
from race_server.live.server.publisher import snapshot_of
from race_server.logs import Log
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.programme import encode_programme
from race_server.net.wire.sheets import course_sheet
from race_server.net.wire.spectate import encode_events, encode_standings
from race_server.scenario.race import Scenario
from race_server.scenario.sensors import Lidar, Radar
from race_server.scenario.track.course import Obstacle
from race_server.session.session import Session
from support.courses import SMALL_RING
from support.messages import PROGRAMME, STANDINGS
from support.servers import wait_until

# What is asked for


class EventLink:
    """A link to a server in the lobby of an event, which tells of it all the time."""

    def __init__(self) -> None:
        self.asked: list[topics.Topic] = []
        self._told: dict[topics.Topic, Callable[[bytes], None]] = {}

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def listen(self, topic: topics.Topic, receive: Callable[[bytes], None]) -> None:
        self._told[topic] = receive

    def ask(self, topic: topics.Topic) -> bytes:
        self.asked.append(topic)
        return b""

    def tell(self) -> None:
        if topics.PROGRAMME in self._told:
            self._told[topics.PROGRAMME](b"")


def test_the_standings_of_a_lobby_are_asked_for_while_an_event_is_told() -> None:
    link = EventLink()

    def is_asked_again() -> bool:
        link.tell()
        return link.asked.count(topics.TABLE) >= 3

    timing = GatewayTiming(race_silence_s=0.05, link_poll_s=0.02)
    with Listener(lambda: cast(ClientLink, link), lambda *_: None, timing):
        wait_until(is_asked_again)


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


def test_who_comes_after_an_event_is_told_of_none(monkeypatch: pytest.MonkeyPatch) -> None:
    now_s = [10.0]
    clock = SimpleNamespace(monotonic=lambda: now_s[0])
    monkeypatch.setattr("race_server.live.gateway.live.time", clock)
    table, event = encode_standings(STANDINGS), encode_programme(PROGRAMME)

    async def play() -> tuple[list[bytes], list[bytes]]:
        live = LiveRace(asyncio.get_running_loop(), Log(), lambda: None, 16)
        early, late = SlowConnection(100), SlowConnection(100)
        live.join(Viewer(outbox_of(early), 30.0))
        live.receive(topics.PROGRAMME, event)
        await asyncio.sleep(0)
        for now_s[0] in (20.0, 20.5):  # another server, without an event
            live.receive(topics.STANDINGS, table)
            await asyncio.sleep(0)
        live.join(Viewer(outbox_of(late), 30.0))
        return early.taken, late.taken

    early, late = asyncio.run(play())
    assert early[1:] == [frame_of(event), frame_of(table), notice_frame("no-event")]
    assert late[1:] == [frame_of(table)]


@pytest.mark.parametrize(("rate", "shown"), [(60, 60), (45, 45), (30, 30), (20, 20), (1, 1)])
def test_a_viewer_is_shown_as_many_snapshots_a_second_as_it_wants(rate: float, shown: int) -> None:
    connection = SlowConnection(room=1000)
    viewer = Viewer(outbox_of(connection), rate)
    for tick in [*range(600, 660), *range(60)]:  # a new race begins at tick 0 again
        viewer.send_snapshot(tick, b"")
    assert len(connection.taken) == pytest.approx(2 * shown, abs=2)


def test_the_snapshot_with_which_a_race_ends_is_shown_to_the_slowest_viewer() -> None:
    connection = SlowConnection(room=10)
    viewer = Viewer(outbox_of(connection), rate=1.0)
    viewer.send_snapshot(600, b"running")
    viewer.send_snapshot(610, b"too early")
    viewer.send_snapshot(611, b"over", is_news=True)
    assert connection.taken == [b"running", b"over"]


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
