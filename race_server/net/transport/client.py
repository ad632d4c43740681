"""The end of a driver or spectator."""

import time
from collections.abc import Callable
from functools import partial
from typing import Any

import zenoh

from race_server.errors import LinkError
from race_server.net.auth.diagnosis import explain_refusal
from race_server.net.auth.keys import ClientKeys
from race_server.net.auth.settings import check_address, client_settings
from race_server.net.transport.link import Link, open_session
from race_server.net.wire import topics
from race_server.net.wire.topics import Topic, key_of

QUERY_TIMEOUT_S = 2.0
# Requests on one key come at half the rate that the server allows, or more slowly.
PACE = 2.0


class ClientLink(Link):
    """The end of a client: queries, subscribes and publishes."""

    def __init__(
        self,
        address: str,
        session_name: str,
        *,
        keys: ClientKeys | None = None,
        timeout_s: float = 5.0,
    ) -> None:
        """Connect to a server.

        Raises:
            LinkError: the address is none, no server answers there, or it refuses this client.
            KeysError: the address requires a certificate.
            WireError: the session's name is not valid.
        """
        key_of(topics.SNAPSHOT, session_name)
        check_address(address)
        settings = client_settings(address, keys, timeout_s)
        try:
            super().__init__(open_session(settings))
        except zenoh.ZError as error:
            raise LinkError(
                f"no server answers at {address} within {timeout_s:g} s. "
                + explain_refusal(address, keys)
            ) from error
        self._name = session_name
        self._kept: list[Any] = []
        self._asked: dict[str, float] = {}

    def ask(
        self, topic: Topic, payload: bytes = b"", seat: int = -1, *, at_once: bool = False
    ) -> bytes:
        """Return the server's answer to a request.

        at_once: also right after the same request, which the server then does not limit.

        Raises:
            LinkError: no answer within two seconds.
        """
        key = key_of(topic, self._name, seat)
        due = self._asked.get(key, 0.0) + PACE / topic.limit_hz
        if not at_once:
            time.sleep(max(due - time.monotonic(), 0.0))
        self._asked[key] = time.monotonic()
        for reply in self._session.get(key, payload=payload, timeout=QUERY_TIMEOUT_S):
            if reply.ok is not None:
                return bytes(reply.ok.payload.to_bytes())
        no_seat = f"it has no seat {seat}, " if seat >= 0 else ""
        raise LinkError(
            f"no answer on {key}: the server has stopped, no session is called {self._name!r}, "
            f"{no_seat}the server does not allow this request, or it has closed this link, "
            "because too many use the same keys or they were revoked"
        )

    def listen(self, topic: Topic, store: Callable[[bytes], None], seat: int = -1) -> None:
        """Call `store` with each message of a topic; it runs in a thread of zenoh."""

        def receive(sample: zenoh.Sample) -> None:
            if len(sample.payload) <= topic.most_bytes:
                store(sample.payload.to_bytes())

        key = key_of(topic, self._name, seat)
        self._kept.append(self._session.declare_subscriber(key, receive))

    def tell(self, topic: Topic, data: bytes, seat: int) -> None:
        """Send a message to the client of a seat."""
        self._session.put(key_of(topic, self._name, seat), data)

    def announce(self, seat: int, badge: str) -> None:
        """Announce this seat's driver to the server until the link closes."""
        key = key_of(topics.ALIVE, self._name, seat, badge)
        self._kept.append(self._session.liveliness().declare_token(key))

    def sender(
        self, seat: int, badge: str, topic: Topic = topics.CONTROL
    ) -> Callable[[bytes], None]:
        """Return a function that sends controls, or messages of another topic, of a seat."""
        publisher = self._session.declare_publisher(
            key_of(topic, self._name, seat),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )
        self._kept.append(publisher)
        return partial(publisher.put, attachment=badge.encode())
