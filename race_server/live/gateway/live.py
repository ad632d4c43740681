"""The live race as all browsers see it: received once, published to all."""

import asyncio
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable
from contextlib import suppress
from typing import NamedTuple

from race_server.core.messages import EventPhase, Phase
from race_server.live.client.race_view import RaceView, Update
from race_server.live.gateway.audience import (
    ALERTS,
    GHOSTS,
    LINKS,
    LOT,
    PROGRAMME,
    STANDINGS,
    TELEMETRY,
    Audience,
    Viewer,
)
from race_server.live.gateway.frames import (
    EVENTS_PER_FRAME,
    MAX_WHOLE_FRAMES,
    EventFrames,
    event_frames,
    frame_of,
    notice_frame,
)
from race_server.logs import Log
from race_server.net.wire import topics
from race_server.net.wire.topics import Topic

# What a new viewer is sent before the events, and after them.
FIRST = (topics.COURSE, topics.RULES, topics.LINE, topics.STANDINGS)
THEN = (
    *(topics.LINKS, topics.LOT, topics.ALERTS, topics.TELEMETRIES),
    *(topics.PROGRAMME, topics.GHOSTS),
    topics.SNAPSHOT,
)
# Messages that are kept for new viewers and published when they change; of some only the newest
# counts for a browser that reads slowly.
_NEWEST = {
    topics.STANDINGS: STANDINGS,
    topics.TABLE: STANDINGS,
    topics.LINKS: LINKS,
    topics.LOT: LOT,
    topics.ALERTS: ALERTS,
    topics.TELEMETRIES: TELEMETRY,
    topics.PROGRAMME: PROGRAMME,
    topics.GHOSTS: GHOSTS,
}
# Of one race: not for viewers who come in another.
_OF_RACE = (topics.LINKS, topics.LOT, topics.ALERTS, topics.TELEMETRIES)
_OF_EVENT = (topics.PROGRAMME, topics.GHOSTS)
_ALL = frozenset({topics.COURSE, topics.RULES, topics.LINE})
# Events that are remembered: as many as `EventFrames` holds.
MAX_EVENTS = EVENTS_PER_FRAME * (MAX_WHOLE_FRAMES + 1)
NO_RACE = "no race yet: the server does not answer; the page goes on by itself once it does"


class Moment(NamedTuple):
    """What readiness and parking are for: they end with it."""

    epoch: int
    is_lobby: bool
    call: tuple[int, int] | None  # of an event: attempts driven before, and until when it waits


class LiveRace:
    """What is known of the race, and its viewers. All but `receive` is for the event loop alone."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        log: Log,
        refresh: Callable[[], None],
        most_waiting: int,
    ) -> None:
        """Begin without a race.

        refresh: has everything asked for again; most_waiting: messages that must all be processed
        and wait for the loop.
        """
        self._loop, self._log, self._refresh = loop, log, refresh
        self._lock = threading.Lock()
        self._slots: dict[Topic, bytes] = {}
        self._queue: deque[tuple[Topic | None, bytes]] = deque(maxlen=most_waiting)
        self._is_scheduled = False
        self._kept: dict[Topic, bytes] = {}  # frames for new viewers
        self._why = ""  # why there is no race, as logged
        self._event_frames = EventFrames(-1)
        self._last_event = 0  # number of the newest event
        self.view = RaceView(MAX_EVENTS)
        self.audience = Audience()
        self.is_there = False
        self.left_at: float | None = None  # when a race that was there has gone

    def receive(self, topic: Topic | None, data: bytes) -> None:
        """Queue a message; None with a reason where the race has gone. Called from any thread."""
        with self._lock:
            if topic is not None and topic.newest_wins:
                self._slots[topic] = data
            else:
                self._queue.append((topic, data))
            if self._is_scheduled:
                return
            self._is_scheduled = True
        with suppress(RuntimeError):  # the loop has ended
            self._loop.call_soon_threadsafe(self._process_all)

    def join(self, viewer: Viewer) -> None:
        """Send a new viewer the state of the race, and all that comes from now on."""
        if not self.is_there:
            viewer.outbox.send_frame(notice_frame("no-race", NO_RACE))
        for frame in (*self._known(FIRST), *self._event_frames.frames(), *self._known(THEN)):
            viewer.outbox.send_frame(frame)
        self.audience.add(viewer)

    def _known(self, wanted: Iterable[Topic]) -> list[bytes]:
        return [self._kept[topic] for topic in wanted if topic in self._kept]

    def leave(self, viewer: Viewer) -> None:
        """Send a viewer no more."""
        self.audience.remove(viewer)

    def server_us(self) -> int | None:
        """Return the server's clock [us] as of now, None before the first snapshot."""
        server_s = self.view.server_s(time.monotonic())
        return None if server_s is None else round(1e6 * server_s)

    @property
    def moment(self) -> Moment:
        """The race, lobby or call that is on."""
        view = self.view
        standings, programme = view.standings, view.programme
        is_lobby = standings is not None and standings.phase == Phase.LOBBY
        is_call = programme is not None and programme.phase == EventPhase.CALLED
        call = (programme.driven, programme.until_us) if programme and is_call else None
        return Moment(view.epoch, is_lobby, call)

    def _process_all(self) -> None:
        with self._lock:
            received = [*self._queue, *self._slots.items()]
            self._queue.clear()
            self._slots.clear()
            self._is_scheduled = False
        for topic, data in received:
            if topic is None:
                self._lose_race(data.decode())
            elif update := self.view.receive(topic, data, time.monotonic()):
                self._publish(topic, data, update)

    def _publish(self, topic: Topic, data: bytes, update: Update) -> None:
        if update.is_other_race:
            self._refresh()  # course and rules may be others too
            self._forget(_OF_RACE)
        if update.is_event_over:
            self._forget(_OF_EVENT)
            self.audience.publish(notice_frame("no-event"))
        if update.is_other_race or self.view.epoch != self._event_frames.epoch:
            self._event_frames, self._last_event = EventFrames(self.view.epoch), 0
        if topic is topics.SNAPSHOT and self.view.snapshot is not None:
            frame = self._kept[topic] = frame_of(data)
            tick, is_news = self.view.snapshot.tick, update.is_other_phase
            self.audience.publish_snapshot(tick, frame, is_news=is_news)
        elif topic in _NEWEST:
            kept = topics.STANDINGS if topic is topics.TABLE else topic
            if frames := self._keep(kept, data):
                self.audience.publish_newest(_NEWEST[topic], *frames)
        elif topic in _ALL:
            for frame in self._keep(topic, data):
                self.audience.publish(frame)
        elif update.events:
            self._publish_events(update)
        if topic is topics.LINE:
            self._find_race()  # asked for after course and rules: a new viewer can be shown a race

    def _keep(self, topic: Topic, data: bytes) -> list[bytes]:
        """Keep a message for new viewers; return it as a frame, nothing where it is the same."""
        frame = frame_of(data)
        if self._kept.get(topic) == frame:
            return []
        self._kept[topic] = frame
        return [frame]

    def _forget(self, kept: Iterable[Topic]) -> None:
        for topic in kept:
            self._kept.pop(topic, None)

    def _publish_events(self, update: Update) -> None:
        events, epoch = list(update.events), self.view.epoch
        if events[0].sequence > self._last_event:
            self._event_frames.add(events)
        else:  # late ones: those for new viewers are written again, in order
            self._event_frames = EventFrames(epoch)
            self._event_frames.add(self.view.events.recent())
        self._last_event = max(self._last_event, events[-1].sequence)
        for frame in event_frames(epoch, events):
            self.audience.publish(frame)

    def _find_race(self) -> None:
        if not self.is_there:
            self.is_there, self.left_at, self._why = True, None, ""
            self._log.say("a race is there")
            self.audience.publish(notice_frame("race"))

    def _lose_race(self, why: str) -> None:
        if why != self._why:
            self._why = why
            self._log.warn("no race", why=why)
        if self.is_there:
            self.is_there, self.left_at = False, time.monotonic()
            self.audience.publish(notice_frame("no-race", NO_RACE))
