"""A spectator: takes no seat, sees the standings, the events and the newest snapshot."""

import threading
import time
from collections import deque

from race_server.core.messages import Event
from race_server.errors import LinkError, WireError
from race_server.live.client.link_stats import ClockOffset
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.lobby import CourseSheet, decode_course, decode_rules
from race_server.net.wire.spectate import (
    SnapshotFrame,
    StandingsFrame,
    decode_events,
    decode_snapshot,
    decode_standings,
)


class Spectator:
    """What a spectator knows. Late comers are told the standings and the recent events first."""

    def __init__(self, link: ClientLink) -> None:
        """Begin to watch.

        Raises:
            LinkError: the server does not answer.
        """
        self._link = link
        self._lock = threading.Lock()
        self._newest: SnapshotFrame | None = None
        self._heard_at = time.monotonic()
        self._offset = ClockOffset()
        self.standings: StandingsFrame | None = None
        self.events: deque[Event] = deque(maxlen=1024)
        self.damaged = 0
        self._last = 0
        link.listen(topics.SNAPSHOT, self._take_snapshot)
        link.listen(topics.STANDINGS, self._take_standings)
        link.listen(topics.EVENTS, self._take_events)
        self._take_standings(self._ask(topics.TABLE))
        self._take_events(self._ask(topics.RECENT))

    def course(self) -> CourseSheet:
        """Return the course."""
        return decode_course(self._ask(topics.COURSE))

    def rules(self) -> tuple[dict[str, str], tuple[str, ...]]:
        """Return the rule book and the names of the items."""
        return decode_rules(self._ask(topics.RULES))

    def refresh(self) -> bool:
        """Ask for the standings; False where nobody answers any more."""
        try:
            self._take_standings(self._ask(topics.TABLE))
        except LinkError:
            return False
        return True

    def snapshot(self) -> SnapshotFrame | None:
        """Return the newest snapshot, if there is one."""
        return self._newest

    def age_s(self) -> float | None:
        """Return how old the newest snapshot is by now, None where there is none."""
        frame = self._newest
        if frame is None:
            return None
        return self._offset.age_s(1e-6 * frame.monotonic_us, time.monotonic())

    def silence_s(self) -> float:
        """Return for how long nothing was heard."""
        return time.monotonic() - self._heard_at

    def _ask(self, topic: topics.Topic) -> bytes:
        begun = time.monotonic()
        answer = self._link.ask(topic)
        self._heard_at = time.monotonic()
        self._offset.note_round_trip(self._heard_at - begun)
        return answer

    def _take_snapshot(self, data: bytes) -> None:
        try:
            frame = decode_snapshot(data)
        except WireError:
            self.damaged += 1
            return
        self._newest, self._heard_at = frame, time.monotonic()
        self._offset.note(1e-6 * frame.monotonic_us, self._heard_at)

    def _take_standings(self, data: bytes) -> None:
        try:
            self.standings = decode_standings(data)
        except WireError:
            self.damaged += 1

    def _take_events(self, data: bytes) -> None:
        try:
            _, events = decode_events(data)
        except WireError:
            self.damaged += 1
            return
        with self._lock:
            for event in events:
                # The recent events and the stream overlap; sequence numbers tell.
                if event.sequence > self._last:
                    self._last = event.sequence
                    self.events.append(event)
