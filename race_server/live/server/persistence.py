"""What is written down of a race, and told no sooner than that."""

from collections.abc import Container, Iterable

from race_server.core.messages import Event
from race_server.live.server.commit_gate import CommitGate, Tickets
from race_server.live.server.journal import Journal
from race_server.live.server.publisher import Publisher
from race_server.session import Session
from race_server.storage.recording.logbook import Logbook
from race_server.storage.recording.reader import Recording
from race_server.storage.results.keeper import Keeper, utc_now


class Persistence:
    """The race in the results file and its recording, where there are such."""

    def __init__(
        self, session: Session, publisher: Publisher, keeper: Keeper | None, logbook: Logbook | None
    ) -> None:
        """Keep races with `keeper`, recordings in `logbook`; `publisher` tells what is written."""
        self._session, self._publisher = session, publisher
        self._keeper, self._logbook = keeper, logbook
        self._journal: Journal | None = None
        self._commit_gate = CommitGate()

    def open(self, pace: str, locals_: Container[int]) -> None:
        """Begin to write down: the race with its laps, and everything that acts on it.

        locals_: seats that are driven from inside the server.
        """
        started_at = utc_now()
        self._commit_gate.clear()
        if self._keeper:
            self._keeper.begin(self._session, pace, started_at)
        if self._logbook:
            self._journal = self._publisher.journal = Journal.of_new_race(
                self._logbook, self._session, pace, started_at, locals_
            )

    def take_up(self, recording: Recording) -> None:
        """Go on with the recording of a race whose server was killed."""
        assert self._logbook is not None
        self._journal = Journal.of_old_race(self._logbook, self._session, recording)
        self._publisher.journal = self._journal

    def look(self) -> None:
        """Note before a tick what must be known after it."""
        if self._keeper:
            self._keeper.look(self._session)

    def note(self, before: int, events: list[Event]) -> None:
        """Write what acted since the last call and what came of it. before: tick at its start."""
        if self._journal:
            self._journal.note(before, events)

    def note_acts(self) -> None:
        """Write what was done while no time passes."""
        if self._journal and self._session.log:
            self._journal.note(self._session.tick, [])

    def announce(self, events: list[Event], *, wait: bool) -> None:
        """Tell events in order, each once it is written down.

        wait: for the disk, as for a driver; without it no tick waits, and they are told later.
        """
        if events:
            tickets: Tickets = ()
            if self._keeper:
                tickets += ((self._keeper, self._keeper.keep(events)),)
            if self._journal:
                tickets += (self._journal.ticket(),)
            self._commit_gate.hold(events, tickets)
        self._tell_released(wait=wait)

    def told(self, events: Iterable[Event]) -> list[Event]:
        """Return those of the events that everybody may know of."""
        return self._commit_gate.told(events)

    def close(self) -> None:
        """Tell the last events and write how the race ended."""
        self._tell_released(wait=True)
        if self._keeper:
            self._keeper.end(self._session)
        if self._journal:
            self._journal.end()
        self._journal = self._publisher.journal = None

    @property
    def backlog(self) -> int:
        """How many messages wait to be recorded."""
        return self._journal.backlog if self._journal else 0

    def _tell_released(self, *, wait: bool) -> None:
        for events in self._commit_gate.released(wait=wait):
            self._publisher.publish_events(events)
