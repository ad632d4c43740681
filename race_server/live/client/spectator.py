"""A spectator: takes no seat, receives the standings, the events and the newest snapshot."""

import threading
import time

from race_server.core.messages import Event, Phase
from race_server.errors import LinkError
from race_server.live.client.listener import Listener
from race_server.live.client.race_view import RaceView
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.lobby import CourseSheet, decode_course, decode_rules
from race_server.net.wire.parking import LotFrame
from race_server.net.wire.spectate import SnapshotFrame, StandingsFrame

# Events that are remembered.
MAX_EVENTS = 1024


class Spectator:
    """What a spectator knows; one that comes late asks for the standings and recent events first.

    Messages arrive in threads of the link; its methods may be called from any thread.
    """

    def __init__(self, link: ClientLink) -> None:
        """Begin to receive.

        Raises:
            LinkError: the server does not answer.
        """
        self._lock = threading.Lock()
        self._view = RaceView(MAX_EVENTS)
        self._final: StandingsFrame | None = None
        wanted = topics.SNAPSHOT, topics.STANDINGS, topics.EVENTS, topics.LOT
        self._listener = Listener(link, wanted, self._receive)
        self._ask(topics.TABLE)
        self._ask(topics.RECENT)

    def course(self) -> CourseSheet:
        """Ask for the course and return it.

        Raises:
            LinkError: no answer.
        """
        return decode_course(self._ask(topics.COURSE))

    def rules(self) -> tuple[dict[str, str], tuple[str, ...]]:
        """Ask for the rule book and the names of the items and return them.

        Raises:
            LinkError: no answer.
        """
        return decode_rules(self._ask(topics.RULES))

    def refresh(self) -> bool:
        """Ask for the standings; False where the server does not answer."""
        try:
            self._ask(topics.TABLE)
        except LinkError:
            return False
        return True

    @property
    def standings(self) -> StandingsFrame | None:
        """The newest standings."""
        return self._view.standings

    @property
    def final(self) -> StandingsFrame | None:
        """The standings of the race that ended last; the next one may have begun since."""
        return self._final

    @property
    def lot(self) -> LotFrame | None:
        """What was drawn for this round in a car park, None where there is none."""
        return self._view.lot

    @property
    def events(self) -> list[Event]:
        """The recent events of the race, each once, oldest first."""
        return self._view.events.recent()

    @property
    def damaged(self) -> int:
        """How many messages could not be decoded."""
        return self._view.damaged

    def snapshot(self) -> SnapshotFrame | None:
        """Return the newest snapshot, None where there is none."""
        return self._view.snapshot

    def age_s(self) -> float | None:
        """Return how old [s] the newest snapshot is by now, None where there is none."""
        with self._lock:
            return self._view.age_s(time.monotonic())

    def silence_s(self) -> float:
        """Return the time [s] since the last message."""
        return self._listener.silence_s()

    def _ask(self, topic: topics.Topic) -> bytes:
        begun = time.monotonic()
        answer = self._listener.ask(topic)
        taken = time.monotonic() - begun
        with self._lock:
            self._view.offset.record_round_trip(taken)
        return answer

    def _receive(self, topic: topics.Topic, data: bytes) -> None:
        with self._lock:
            self._view.receive(topic, data, time.monotonic())
            standings = self._view.standings
            if standings is not None and standings.phase is Phase.FINISHED:
                self._final = standings
