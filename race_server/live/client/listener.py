"""Hears a race as spectators do, and asks for what came before."""

import time
from collections.abc import Callable, Iterable
from functools import partial

from race_server.net.transport import ClientLink
from race_server.net.wire.topics import Topic

Store = Callable[[Topic, bytes], None]


class Listener:
    """Passes on each message, in threads of the link, and each answer."""

    def __init__(self, link: ClientLink, wanted: Iterable[Topic], store: Store) -> None:
        """Begin to hear. store: takes each message with its topic."""
        self._link, self._store = link, store
        self._heard_at = time.monotonic()
        for topic in wanted:
            link.listen(topic, partial(self._hear, topic))

    def ask(self, topic: Topic) -> bytes:
        """Ask for something; return the answer, which is passed on, too.

        Raises:
            LinkError: no answer.
        """
        answer = self._link.ask(topic)
        self._hear(topic, answer)
        return answer

    def silence_s(self) -> float:
        """Return the time [s] since the last message."""
        return time.monotonic() - self._heard_at

    def _hear(self, topic: Topic, data: bytes) -> None:
        self._heard_at = time.monotonic()
        self._store(topic, data)
