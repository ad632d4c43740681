"""A spectator in a thread of its own: waits for a race, hears it, and notices when it has gone."""

import threading
import time
from collections.abc import Callable
from typing import Self

from race_server.errors import LinkError, RaceError
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.topics import Topic

# What a newcomer is told, in this order; and what is heard from then on.
ASKED = (topics.COURSE, topics.RULES, topics.LINE, topics.TABLE, topics.RECENT)
HEARD = (topics.SNAPSHOT, topics.STANDINGS, topics.EVENTS, topics.LINKS)
# Between two looks at the link, and between two attempts to connect.
LOOK_S, RETRY_S = 0.5, 0.5
# A lobby says nothing by itself: after so long it is asked whether it is there.
SILENCE_S = 1.5

# What was heard: a topic with its message; None with a sentence where the race has gone.
Hear = Callable[[Topic | None, bytes], None]


class Listener:
    """Hands on whatever spectators hear, and what they may ask for."""

    def __init__(self, connect: Callable[[], ClientLink], hear: Hear) -> None:
        """Get ready.

        connect: returns a link, or raises. hear: is called from threads.
        """
        self._connect, self._hear = connect, hear
        self._heard_at = time.monotonic()
        self._ended = threading.Event()
        self._asked_for = threading.Event()
        self._thread = threading.Thread(target=self._work, name="spectator", daemon=True)
        self.round_trip_s = 0.0  # the shortest

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def ask_again(self) -> None:
        """Have everything asked for again soon: another race has begun."""
        self._asked_for.set()

    def _work(self) -> None:
        while not self._ended.is_set():
            try:
                link = self._connect()
            except RaceError as error:
                self._hear(None, str(error).encode())
                self._ended.wait(RETRY_S)
                continue
            with link:
                for topic in HEARD:
                    link.listen(topic, self._taker(topic))
                self._stay(link)

    def _taker(self, topic: Topic) -> Callable[[bytes], None]:
        def take(data: bytes) -> None:
            self._heard_at = time.monotonic()
            self._hear(topic, data)

        return take

    def _stay(self, link: ClientLink) -> None:
        """Listen until the end; zenoh connects again by itself."""
        self._asked_for.set()
        while True:
            try:
                if self._asked_for.is_set():
                    self._asked_for.clear()
                    self._ask_all(link)
                elif time.monotonic() - self._heard_at > SILENCE_S:
                    self._ask(link, topics.TABLE)
            except LinkError as error:
                self._asked_for.set()
                self._hear(None, str(error).encode())
            if self._ended.wait(LOOK_S):
                return

    def _ask_all(self, link: ClientLink) -> None:
        for topic in ASKED:
            self._ask(link, topic)

    def _ask(self, link: ClientLink, topic: Topic) -> None:
        begun = time.monotonic()
        data = link.ask(topic)
        self._heard_at = time.monotonic()
        taken = self._heard_at - begun
        self.round_trip_s = min(self.round_trip_s or taken, taken)
        self._hear(topic, data)
