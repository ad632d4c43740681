"""The live race as all browsers see it: heard once, told to everybody."""

import asyncio
import json
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress

from race_server.errors import WireError
from race_server.live.client.link_stats import ClockOffset
from race_server.live.gateway.audience import LINKS, STANDINGS, Audience, Viewer
from race_server.live.gateway.connection import frame_of
from race_server.live.gateway.event_frames import EventFrames, event_frames
from race_server.logs import Log
from race_server.net.wire import topics
from race_server.net.wire.line import decode_line
from race_server.net.wire.links import decode_links
from race_server.net.wire.lobby import CourseSheet, decode_course, decode_rules
from race_server.net.wire.spectate import (
    SnapshotFrame,
    decode_events,
    decode_snapshot,
    decode_standings,
)
from race_server.net.wire.topics import Topic

# What a newcomer is told before the events, and after them.
FIRST = (topics.COURSE, topics.RULES, topics.LINE, topics.STANDINGS)
THEN = (topics.LINKS, topics.SNAPSHOT)
# Ticks of a race that go back by more than this are those of another race.
BACK_TICKS = 60
# Messages of which each counts wait for the loop in such a number at most.
MOST_HEARD = 1024
NO_RACE = "no race yet: the server does not answer; the page goes on by itself once it does"


def notice_frame(code: str, reason: str = "") -> bytes:
    """Return a notice as a frame."""
    return frame_of(json.dumps({"type": "notice", "code": code, "reason": reason}))


class LiveRace:
    """What is known of the race, and who watches it. All but `hear` is for the loop alone."""

    def __init__(self, loop: asyncio.AbstractEventLoop, log: Log, refresh: Callable[[], None]):
        """Know nothing yet. refresh: has everything asked for again."""
        self._loop, self._log, self._refresh = loop, log, refresh
        self._lock = threading.Lock()
        self._slots: dict[Topic, bytes] = {}
        self._queue: deque[tuple[Topic | None, bytes]] = deque(maxlen=MOST_HEARD)
        self._is_called = False
        self._kept: dict[Topic, bytes] = {}  # frames for newcomers
        self._last = 0  # number of the newest event
        self._why = ""  # why there is no race, as told to the log
        self.audience = Audience()
        self.offset = ClockOffset()
        self.is_there = False
        self.left_at: float | None = None  # when a race that was there has gone
        self.damaged = 0
        self.epoch = -1
        self._roll = EventFrames(self.epoch)
        self.snapshot: SnapshotFrame | None = None
        self.course: CourseSheet | None = None
        self._takers: dict[Topic, Callable[[bytes], None]] = {
            topics.SNAPSHOT: self._take_snapshot,
            topics.STANDINGS: self._take_standings,
            topics.TABLE: self._take_standings,
            topics.LINKS: self._take_links,
            topics.EVENTS: self._take_events,
            topics.RECENT: self._take_events,
            topics.COURSE: self._take_course,
            topics.RULES: self._take_rules,
            topics.LINE: self._take_line,
        }

    def hear(self, topic: Topic | None, data: bytes) -> None:
        """Take something from any thread; None with a reason where the race has gone."""
        with self._lock:
            if topic is not None and topic.newest_wins:
                self._slots[topic] = data
            else:
                self._queue.append((topic, data))
            if self._is_called:
                return
            self._is_called = True
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._take_all)

    def join(self, viewer: Viewer) -> None:
        """Tell a newcomer how the race stands, and whatever comes from now on."""
        if not self.is_there:
            viewer.outbox.put(notice_frame("no-race", NO_RACE))
        for frame in (*self._known(FIRST), *self._roll.frames(), *self._known(THEN)):
            viewer.outbox.put(frame)
        self.audience.join(viewer)

    def _known(self, wanted: Iterable[Topic]) -> list[bytes]:
        return [self._kept[topic] for topic in wanted if topic in self._kept]

    def leave(self, viewer: Viewer) -> None:
        """Let somebody go."""
        self.audience.leave(viewer)

    def server_us(self) -> int:
        """Return what the server's clock shows now; our own where it was not heard yet."""
        now = time.monotonic()
        if self.snapshot is None:
            return round(1e6 * now)
        sent_s = 1e-6 * self.snapshot.monotonic_us
        return round(1e6 * (sent_s + self.offset.age_s(sent_s, now)))

    def _take_all(self) -> None:
        with self._lock:
            heard = [*self._queue, *self._slots.items()]
            self._queue.clear()
            self._slots.clear()
            self._is_called = False
        for topic, data in heard:
            try:
                if topic is None:
                    self._lose(data.decode())
                else:
                    self._takers[topic](data)
            except WireError:
                self.damaged += 1

    def _find(self) -> None:
        if not self.is_there:
            self.is_there, self.left_at, self._why = True, None, ""
            self._log.say("a race is there")
            self.audience.put(notice_frame("race"))

    def _lose(self, why: str) -> None:
        if why != self._why:
            self._why = why
            self._log.warn("no race", why=why)
        if self.is_there:
            self.is_there, self.left_at = False, time.monotonic()
            self.audience.put(notice_frame("no-race", NO_RACE))

    def _turn_to(self, epoch: int, *, anew: bool = False) -> None:
        """Take note that another race has begun: course and rules may be others too.

        anew: whatever its number; a server that is started again counts from one.
        """
        if epoch == self.epoch and not anew:
            return
        if self.epoch >= 0:
            self._refresh()
            self.offset.restart()
        self.epoch, self.snapshot, self._last = epoch, None, 0
        self._roll = EventFrames(epoch)

    def _keep(self, topic: Topic, data: bytes) -> bytes | None:
        """Return a message as a frame and keep it for newcomers; None where it is known."""
        frame = frame_of(data)
        if self._kept.get(topic) == frame:
            return None
        self._kept[topic] = frame
        return frame

    def _take_snapshot(self, data: bytes) -> None:
        snapshot = decode_snapshot(data)
        before = self.snapshot
        # A race that was taken up begins a few ticks earlier, another one much more.
        self._turn_to(
            snapshot.epoch, anew=before is not None and snapshot.tick + BACK_TICKS < before.tick
        )
        self.snapshot = snapshot
        self.offset.note(1e-6 * snapshot.monotonic_us, time.monotonic())
        frame = frame_of(data)
        self._kept[topics.SNAPSHOT] = frame
        self.audience.show_snapshot(snapshot.tick, frame)

    def _take_standings(self, data: bytes) -> None:
        self._turn_to(decode_standings(data).epoch)
        if frame := self._keep(topics.STANDINGS, data):
            self.audience.show(STANDINGS, frame)

    def _take_links(self, data: bytes) -> None:
        decode_links(data)
        if frame := self._keep(topics.LINKS, data):
            self.audience.show(LINKS, frame)

    def _take_events(self, data: bytes) -> None:
        epoch, events = decode_events(data)
        self._turn_to(epoch)
        # The recent events and the stream overlap; their numbers tell.
        fresh = [event for event in events if event.sequence > self._last]
        if not fresh:
            return
        self._last = fresh[-1].sequence
        self._roll.add(fresh)
        for frame in event_frames(epoch, fresh):
            self.audience.put(frame)

    def _take_course(self, data: bytes) -> None:
        course = decode_course(data)
        if frame := self._keep(topics.COURSE, data):
            self.course = course
            self.audience.put(frame)

    def _take_rules(self, data: bytes) -> None:
        decode_rules(data)
        if frame := self._keep(topics.RULES, data):
            self.audience.put(frame)

    def _take_line(self, data: bytes) -> None:
        decode_line(data)
        if frame := self._keep(topics.LINE, data):
            self.audience.put(frame)
        # Asked for after course and rules: whoever comes now can be shown a race.
        self._find()
