"""zenoh, and nothing else that knows it.

The server's session is the router: it listens on one address, with scouting, gossip and shared
memory off. Callbacks do no more than put bytes into bounded mailboxes; the server's loop empties
them. A session that is not closed keeps its process alive, so both ends are context managers and
are closed at exit as well.
"""

import atexit
import json
import threading
from collections import deque
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Self

import zenoh

from race_server.errors import LinkError
from race_server.wire import topics
from race_server.wire.topics import Topic, key_of

DEFAULT_ADDRESS = "tcp/127.0.0.1:7447"
# A link that is silent for so long is given up. Who leaves is seen at once; this is for hosts that
# die, and long enough that a network which loses a fifth of all packets breaks no link.
LEASE_MS = 6000
# What waits in the kernel can no longer be overtaken by something newer, so little may.
SEND_BUFFER = 32768
# The loop of a server waits for nobody's network: newest-wins messages soon fall out where a
# link is full, events have room for seconds, and a link that takes none of them is given up [µs].
QUEUE = {
    "size": {"real_time": 4, "interactive_high": 16},
    "congestion_control": {
        "drop": {"wait_before_drop": 200},
        "block": {"wait_before_close": 50_000},
    },
}
# So many controls of a seat wait at most; more push the oldest out. Not one alone: rubbish that
# comes after an honest control must not hide it.
MOST_INPUTS = 8
# More unanswered requests than this are dropped; the asker's timeout tells it.
MOST_QUERIES = 256
QUERY_TIMEOUT_S = 2.0


def _config(mode: str, where: str, address: str, *, timeout_ms: int) -> zenoh.Config:
    config = zenoh.Config()
    settings: dict[str, Any] = {
        "mode": mode,
        f"{where}/endpoints": [address],
        f"{where}/timeout_ms": timeout_ms,
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        "transport/shared_memory/enabled": False,
        "transport/link/tx/lease": LEASE_MS,
        "transport/link/tcp/so_sndbuf": SEND_BUFFER,
        "transport/link/tx/queue": QUEUE,
    }
    if where == "connect":
        settings["connect/exit_on_failure"] = True
        settings["connect/retry"] = {
            "period_init_ms": 100,
            "period_max_ms": 500,
            "period_increase_factor": 1.5,
        }
        settings["listen/endpoints"] = []
    else:
        settings["connect/endpoints"] = []
        settings["listen/exit_on_failure"] = True
    for key, value in settings.items():
        config.insert_json5(key, json.dumps(value))
    return config


@dataclass(frozen=True)
class Request:
    """A query that waits for an answer."""

    topic: Topic
    payload: bytes
    _query: Any

    def answer(self, payload: bytes) -> None:
        """Send the answer and end the query."""
        self._query.reply(self._query.key_expr, payload)
        self._query.drop()


class _Link:
    """A zenoh session with a life."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._is_open = True
        atexit.register(self.close)

    def close(self) -> None:
        """End the session; a second call does nothing."""
        if self._is_open:
            self._is_open = False
            atexit.unregister(self.close)
            self._session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.close()


class ServerLink(_Link):
    """The server's end: hears all seats, tells everybody."""

    def __init__(self, address: str, session_name: str, seats: int) -> None:
        """Listen on `address`.

        Raises:
            LinkError: it cannot be listened on.
            WireError: the session's name is none.
        """
        key_of(topics.SNAPSHOT, session_name)
        try:
            config = _config("router", "listen", address, timeout_ms=0)
            super().__init__(zenoh.open(config))
        except zenoh.ZError as error:
            raise LinkError(
                f"cannot listen on {address}: it is in use or not of this machine; "
                "choose another address with --listen, such as tcp/127.0.0.1:7448"
            ) from error
        self.address = address
        self.oversized = 0
        self.foreign = 0
        self._name = session_name
        self._inputs: list[deque[bytes]] = [deque(maxlen=MOST_INPUTS) for _ in range(seats)]
        self._arrived = threading.Event()
        self._requests: deque[Request] = deque(maxlen=MOST_QUERIES)
        self._presence: deque[tuple[int, bool]] = deque()
        self._publishers: dict[tuple[str, int], Any] = {}
        self._kept: list[Any] = [self._hear_seat(seat) for seat in range(seats)]
        self._kept += [self._hear_queries(topic) for topic in topics.QUERIES]
        self._kept.append(self._hear_presence())

    def _hear_seat(self, seat: int) -> Any:
        most = topics.CONTROL.most_bytes

        def store(sample: zenoh.Sample) -> None:
            if len(sample.payload) > most:
                self.oversized += 1
                return
            data = sample.payload.to_bytes()
            if data[4:8] != topics.CONTROL.identifier:
                self.foreign += 1
                return
            self._inputs[seat].append(data)
            self._arrived.set()

        key = key_of(topics.CONTROL, self._name, seat)
        return self._session.declare_subscriber(key, store, allowed_origin=zenoh.Locality.REMOTE)

    def _hear_queries(self, topic: Topic) -> Any:
        def store(query: zenoh.Query) -> None:
            payload = query.payload.to_bytes() if query.payload is not None else b""
            if len(payload) > topic.most_bytes:
                self.oversized += 1
                return
            self._requests.append(Request(topic, payload, query))
            self._arrived.set()

        key = key_of(topic, self._name)
        return self._session.declare_queryable(key, store, complete=True)

    def _hear_presence(self) -> Any:
        def store(sample: zenoh.Sample) -> None:
            seat = str(sample.key_expr).rsplit("/", 1)[1]
            if seat.isdigit() and int(seat) < len(self._inputs):
                self._presence.append((int(seat), sample.kind == zenoh.SampleKind.PUT))
                self._arrived.set()

        key = key_of(topics.ALIVE, self._name).replace("-1", "*")
        return self._session.liveliness().declare_subscriber(key, store, history=True)

    def take_inputs(self) -> list[tuple[int, bytes]]:
        """Return the newest controls of each seat since the last call, oldest first."""
        self._arrived.clear()
        found = []
        for seat, mailbox in enumerate(self._inputs):
            while mailbox:
                found.append((seat, mailbox.popleft()))
        return found

    def take_requests(self) -> Iterable[Request]:
        """Yield the requests that wait for an answer."""
        while self._requests:
            yield self._requests.popleft()

    def take_presence(self) -> Iterable[tuple[int, bool]]:
        """Yield seats whose driver's link came up (True) or went away (False)."""
        while self._presence:
            yield self._presence.popleft()

    def clients(self) -> int:
        """Return how many links of others are open."""
        return len(self._session.info.transports())

    def wait(self, timeout_s: float) -> bool:
        """Return True once something has arrived since `take_inputs`, False at the timeout."""
        return self._arrived.wait(timeout_s)

    def publish(self, topic: Topic, payload: bytes, seat: int = -1) -> None:
        """Send a message to who listens to the topic."""
        publisher = self._publishers.get((topic.key, seat))
        if publisher is None:
            newest = topic.newest_wins
            publisher = self._session.declare_publisher(
                key_of(topic, self._name, seat),
                congestion_control=(
                    zenoh.CongestionControl.DROP if newest else zenoh.CongestionControl.BLOCK
                ),
                priority=zenoh.Priority.REAL_TIME if newest else zenoh.Priority.INTERACTIVE_HIGH,
                express=True,
            )
            self._publishers[topic.key, seat] = publisher
        publisher.put(payload)


class ClientLink(_Link):
    """A driver's or spectator's end."""

    def __init__(self, address: str, session_name: str, *, timeout_s: float = 5.0) -> None:
        """Connect to a server.

        Raises:
            LinkError: nobody answers there.
            WireError: the session's name is none.
        """
        key_of(topics.SNAPSHOT, session_name)
        try:
            config = _config("client", "connect", address, timeout_ms=round(timeout_s * 1000))
            super().__init__(zenoh.open(config))
        except zenoh.ZError as error:
            raise LinkError(
                f"no server answers at {address} within {timeout_s:g} s. Is `race serve` running "
                "there? A refused login looks the same."
            ) from error
        self._name = session_name
        self._kept: list[Any] = []

    def ask(self, topic: Topic, payload: bytes = b"") -> bytes:
        """Return the server's answer to a request.

        Raises:
            LinkError: no answer within two seconds.
        """
        key = key_of(topic, self._name)
        for reply in self._session.get(key, payload=payload, timeout=QUERY_TIMEOUT_S):
            if reply.ok is not None:
                return bytes(reply.ok.payload.to_bytes())
        raise LinkError(
            f"no answer on {key}: the server has gone, or no session is called {self._name!r}"
        )

    def listen(self, topic: Topic, store: Callable[[bytes], None], seat: int = -1) -> None:
        """Call `store` with each message of a topic; it runs in a thread of zenoh."""

        def receive(sample: zenoh.Sample) -> None:
            if len(sample.payload) <= topic.most_bytes:
                store(sample.payload.to_bytes())

        key = key_of(topic, self._name, seat)
        self._kept.append(self._session.declare_subscriber(key, receive))

    def announce(self, seat: int) -> None:
        """Show the server that this seat's driver is there, for as long as the link is."""
        token = self._session.liveliness().declare_token(key_of(topics.ALIVE, self._name, seat))
        self._kept.append(token)

    def sender(self, seat: int) -> Callable[[bytes], None]:
        """Return what sends a control of a seat."""
        publisher = self._session.declare_publisher(
            key_of(topics.CONTROL, self._name, seat),
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )
        self._kept.append(publisher)
        return publisher.put


class Mailbox:
    """Holds the newest message until somebody takes it."""

    def __init__(self) -> None:
        self._newest: bytes | None = None
        self._condition = threading.Condition()

    def put(self, data: bytes) -> None:
        """Store a message; an older one that nobody took is forgotten."""
        with self._condition:
            self._newest = data
            self._condition.notify()

    def take(self, timeout_s: float) -> bytes | None:
        """Return the newest message, or None if none comes within `timeout_s`."""
        with self._condition:
            if self._newest is None:
                self._condition.wait(timeout_s)
            data, self._newest = self._newest, None
            return data
