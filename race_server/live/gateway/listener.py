"""A spectator in a thread: waits for a race, receives it, and notices when it has gone."""

import threading
import time
from collections.abc import Callable
from typing import Self

from race_server.errors import LinkError, RaceError
from race_server.live.gateway.limits import GatewayTiming
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.topics import Topic

# What is asked for once a race is there, in this order; and what is received from then on.
ASKED = (topics.COURSE, topics.RULES, topics.LINE, topics.TABLE, topics.RECENT)
RECEIVED = (
    *(topics.SNAPSHOT, topics.STANDINGS, topics.EVENTS, topics.LINKS, topics.LOT),
    *(topics.ALERTS, topics.TELEMETRIES, topics.PROGRAMME, topics.GHOSTS),
)
# What a race sends all the time and a lobby does not: without it the standings are asked for. An
# answer may be overtaken by newer standings, and in the lobby of an event nothing would mend that.
SIGNS = (topics.SNAPSHOT, topics.STANDINGS)

# A topic with its message; None with a sentence where the race has gone.
Receive = Callable[[Topic | None, bytes], None]


class Listener:
    """Passes on what spectators receive, and what they may ask for."""

    def __init__(
        self, connect: Callable[[], ClientLink], receive: Receive, timing: GatewayTiming
    ) -> None:
        """Prepare; the thread runs inside a `with` block.

        connect: returns a link, or raises. receive: is called from threads.
        """
        self._connect, self._receive, self._timing = connect, receive, timing
        self._received_at = time.monotonic()
        self._ended = threading.Event()
        self._must_ask = threading.Event()
        self._thread = threading.Thread(target=self._run, name="spectator", daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        self._thread.join()

    def request_all(self) -> None:
        """Have everything asked for again soon: another race has begun."""
        self._must_ask.set()

    def _run(self) -> None:
        while not self._ended.is_set():
            try:
                link = self._connect()
            except RaceError as error:
                self._receive(None, str(error).encode())
                self._ended.wait(self._timing.reconnect_s)
                continue
            with link:
                for topic in RECEIVED:
                    link.listen(topic, self._receiver_of(topic))
                self._stay(link)

    def _receiver_of(self, topic: Topic) -> Callable[[bytes], None]:
        def receive(data: bytes) -> None:
            if topic in SIGNS:
                self._received_at = time.monotonic()
            self._receive(topic, data)

        return receive

    def _stay(self, link: ClientLink) -> None:
        """Keep a link until the end; zenoh reconnects by itself."""
        self._must_ask.set()
        while True:
            try:
                if self._must_ask.is_set():
                    self._must_ask.clear()
                    for topic in ASKED:
                        self._ask(link, topic)
                elif time.monotonic() - self._received_at > self._timing.race_silence_s:
                    self._ask(link, topics.TABLE)
            except LinkError as error:
                self._must_ask.set()
                self._receive(None, str(error).encode())
            if self._ended.wait(self._timing.link_poll_s):
                return

    def _ask(self, link: ClientLink, topic: Topic) -> None:
        data = link.ask(topic)
        self._received_at = time.monotonic()
        self._receive(topic, data)
