"""Persistence of a race: its events are announced only once they are written."""

import time
from collections import deque
from collections.abc import Container, Iterable, Iterator

from race_server.core.messages import Event
from race_server.live.server.journal import Journal
from race_server.live.server.timing import ServerTiming
from race_server.net.wire.topics import Topic
from race_server.session.session import Session
from race_server.storage.queue import Ticket
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import Recording
from race_server.storage.results.keeper import Keeper, utc_now

# A server that an exception ends waits for its disk no longer than this.
LEAVE_S = 1.0


class CommitGate:
    """Holds events back, in order, until they are written."""

    def __init__(self, hold_s: float) -> None:
        """Hold nothing. hold_s: no event is held longer, whatever the disk does."""
        self._hold_s = hold_s
        self._held: deque[tuple[list[Ticket], float, list[Event]]] = deque()

    def clear(self) -> None:
        """Forget what is held: another race begins."""
        self._held.clear()

    def hold(self, events: list[Event], tickets: list[Ticket]) -> None:
        """Hold events until their tickets are settled."""
        if events:
            self._held.append((tickets, time.monotonic() + self._hold_s, events))

    def released(self, *, wait: bool) -> Iterator[list[Event]]:
        """Yield, in order, the events that may be announced now; with `wait`, all of them."""
        while self._held:
            tickets, deadline, events = self._held[0]
            if wait:
                for ticket in tickets:
                    ticket.wait(max(deadline - time.monotonic(), 0.0))
            elif time.monotonic() < deadline and not all(ticket.is_settled for ticket in tickets):
                return
            self._held.popleft()
            yield events

    def announced(self, events: Iterable[Event]) -> list[Event]:
        """Return those of the events that are not held back."""
        first = self._held[0][2][0].sequence if self._held else None
        return [event for event in events if first is None or event.sequence < first]


class Persistence:
    """The race in the results file and its recording, where there are such."""

    def __init__(
        self, session: Session, keeper: Keeper | None, logbook: Logbook | None, timing: ServerTiming
    ) -> None:
        """Keep races of a session with `keeper`, recordings in `logbook`."""
        self._session = session
        self._keeper, self._logbook = keeper, logbook
        self._journal: Journal | None = None
        self._gate = CommitGate(timing.hold_s)

    def open(self, pace: str, locals_: Container[int]) -> None:
        """Begin to write: the race with its laps, and all its inputs.

        locals_: seats that are driven from inside the server.
        """
        started_at = utc_now()
        self._gate.clear()
        if self._keeper:
            self._keeper.begin(self._session, pace, started_at)
        if self._logbook:
            self._journal = Journal.of_new_race(
                self._logbook, self._session, pace, started_at, locals_
            )

    def resume(self, recording: Recording) -> None:
        """Continue the recording of a race whose server was killed."""
        assert self._logbook is not None
        self._journal = Journal.of_old_race(self._logbook, self._session, recording)

    def publish(self, topic: Topic, payload: bytes) -> None:
        """Record what spectators are sent."""
        if self._journal:
            self._journal.publish(topic, payload)

    def record(self, before: int, events: list[Event]) -> None:
        """Write the inputs and events since the last call. before: tick before the last advance.

        The events are held until they are written, see `released`.
        """
        tickets = []
        if self._journal:
            self._journal.record(before, events)
        if events and self._keeper:
            laps = self._session.event_log.laps.laps_in(events)
            tickets.append(self._keeper.add_laps(laps))
        if events and self._journal:
            tickets.append(self._journal.flush())
        self._gate.hold(events, tickets)

    def record_interventions(self) -> None:
        """Write what was done while no time passes."""
        if self._journal and self._session.journal.entries:
            self._journal.record(self._session.tick, [])

    def released(self, *, wait: bool) -> Iterator[list[Event]]:
        """Yield, in order, the events that may be announced now.

        wait: for the disk, as for a driver; without it no tick waits, and they come later.
        """
        return self._gate.released(wait=wait)

    def announced(self, events: Iterable[Event]) -> list[Event]:
        """Return those of the events that spectators may know of."""
        return self._gate.announced(events)

    def close(self) -> None:
        """Write how the race ended."""
        if self._keeper:
            self._keeper.end(self._session)
        if self._journal:
            self._journal.close()
        self._journal = None

    def leave(self) -> None:
        """Have what was recorded so far written, and leave the race without an end."""
        if self._journal:
            self._journal.flush().wait(LEAVE_S)

    @property
    def backlog(self) -> int:
        """How many messages wait to be recorded."""
        return self._journal.backlog if self._journal else 0
