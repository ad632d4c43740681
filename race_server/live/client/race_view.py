"""What a spectator knows of a race: fed with messages, without links, threads or a clock."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from race_server.core.messages import Event, Phase
from race_server.errors import WireError
from race_server.live.client.clock_offset import ClockOffset
from race_server.live.client.event_stream import EventStream
from race_server.net.wire import topics
from race_server.net.wire.alert import AlertsFrame, decode_alerts
from race_server.net.wire.ghosts import decode_ghosts
from race_server.net.wire.line import decode_line
from race_server.net.wire.links import decode_links
from race_server.net.wire.lobby import CourseSheet, decode_course, decode_rules
from race_server.net.wire.parking import LotFrame, decode_lot
from race_server.net.wire.programme import ProgrammeFrame, decode_programme
from race_server.net.wire.spectate import (
    SnapshotFrame,
    StandingsFrame,
    decode_events,
    decode_snapshot,
    decode_standings,
)
from race_server.net.wire.telemetry import TelemetriesFrame, decode_telemetries
from race_server.net.wire.topics import Topic

# A snapshot whose tick is lower than the last by more than this is of another race; a race that is
# resumed from its journal goes back by less.
BACK_TICKS = 60
# A server of an event tells its programme twice a second: a server that tells the standings again
# and again, and for this long [s] no programme, has none.
EVENT_GONE_S, TABLES_WITHOUT = 3.0, 2

# A race whose first snapshot is this much [s] off comes from a server with another clock.
CLOCK_JUMP_S = 5.0

_DECODERS: dict[Topic, Callable[[bytes], Any]] = {
    topics.SNAPSHOT: decode_snapshot,
    topics.STANDINGS: decode_standings,
    topics.TABLE: decode_standings,
    topics.LINKS: decode_links,
    topics.LOT: decode_lot,
    topics.ALERTS: decode_alerts,
    topics.TELEMETRIES: decode_telemetries,
    topics.PROGRAMME: decode_programme,
    topics.GHOSTS: decode_ghosts,
    topics.EVENTS: decode_events,
    topics.RECENT: decode_events,
    topics.COURSE: decode_course,
    topics.RULES: decode_rules,
    topics.LINE: decode_line,
}


@dataclass(frozen=True)
class Update:
    """What a message has changed."""

    is_other_race: bool = False  # another race than before, of which something was known
    events: tuple[Event, ...] = ()  # not known before
    is_other_phase: bool = False  # than that of the snapshot before
    is_event_over: bool = False  # the server has no event any more


class RaceView:
    """The newest snapshot, standings and course, and the events, of the race that goes on."""

    def __init__(self, most_events: int) -> None:
        """Begin without any message. most_events: that are remembered."""
        self.epoch = -1
        self.snapshot: SnapshotFrame | None = None
        self.standings: StandingsFrame | None = None
        self.course: CourseSheet | None = None
        self.lot: LotFrame | None = None  # of a car park
        self.alerts: AlertsFrame | None = None  # of real karts
        self.telemetry: TelemetriesFrame | None = None  # of the same
        self.programme: ProgrammeFrame | None = None  # of an event
        self._programme_at, self._tables_without = 0.0, 0  # when it came [s], standings since
        self.events = EventStream(most_events)
        self.offset = ClockOffset()
        self.damaged = 0  # messages that could not be decoded

    def receive(self, topic: Topic, data: bytes, now_s: float) -> Update | None:
        """Record a message and return what it changed; None where it is damaged.

        now_s: when it was received, by `time.monotonic`.
        """
        try:
            message = _DECODERS[topic](data)
        except WireError:
            self.damaged += 1
            return None
        if topic is topics.SNAPSHOT:
            return self._receive_snapshot(message, now_s)
        if topic in {topics.STANDINGS, topics.TABLE}:
            is_other = self._enter(message.epoch)
            self.standings = message
            return Update(is_other, is_event_over=self._ends_event(topic, message, now_s))
        if topic in {topics.EVENTS, topics.RECENT}:
            epoch, events = message
            is_other = self._enter(epoch)
            return Update(is_other, tuple(self.events.receive(epoch, events)))
        if topic is topics.COURSE:
            self.course = message
        if topic is topics.LOT:
            self.lot = message
        if topic is topics.ALERTS:
            self.alerts = message
        if topic is topics.TELEMETRIES:
            self.telemetry = message
        if topic is topics.PROGRAMME:
            self.programme, self._programme_at, self._tables_without = message, now_s, 0
        return Update()

    def _receive_snapshot(self, frame: SnapshotFrame, now_s: float) -> Update:
        before = self.snapshot
        went_back = before is not None and frame.tick + BACK_TICKS < before.tick
        is_other = self._enter(frame.epoch, restarted=went_back)
        sent_s = 1e-6 * frame.monotonic_us
        if self.snapshot is None and abs(now_s - sent_s - self.offset.offset_s) > CLOCK_JUMP_S:
            self.offset.restart()
        self.snapshot = frame
        self.offset.record(sent_s, now_s)
        is_other_phase = before is not None and before.phase != frame.phase
        return Update(is_other, is_other_phase=is_other_phase)

    def _ends_event(self, topic: Topic, standings: StandingsFrame, now_s: float) -> bool:
        """Forget an event that is told no more with these standings; return whether it was one.

        While a race is interrupted nothing is told but the answers that are asked for.
        """
        tells_event = topic is topics.STANDINGS or standings.phase == Phase.LOBBY
        if self.programme is None or not tells_event:
            return False
        self._tables_without += 1
        is_long = now_s - self._programme_at > EVENT_GONE_S
        if not is_long or self._tables_without < TABLES_WITHOUT:
            return False
        self.programme = None
        return True

    def _enter(self, epoch: int, *, restarted: bool = False) -> bool:
        """Begin another race; return whether one was known before.

        restarted: even with the same number, as a server that is started again counts from one.
        """
        if epoch == self.epoch and not restarted:
            return False
        is_other = self.epoch >= 0
        if restarted or epoch < self.epoch:
            self.offset.restart()
        self.epoch, self.snapshot, self.lot = epoch, None, None
        self.alerts = self.telemetry = None
        self.events.begin(epoch)
        return is_other

    def server_s(self, now_s: float) -> float | None:
        """Return the server's clock [s], None before the first snapshot."""
        offset_s = self.offset.offset_s
        return now_s - offset_s if offset_s < float("inf") else None

    def age_s(self, now_s: float) -> float | None:
        """Return how old [s] the newest snapshot is, None where there is none."""
        frame = self.snapshot
        return None if frame is None else self.offset.age_s(1e-6 * frame.monotonic_us, now_s)
