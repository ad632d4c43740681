"""The end of the server."""

import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import zenoh

from race_server.errors import LinkError
from race_server.net.auth.access import common_name, seat_name
from race_server.net.auth.keys import ServerKeys
from race_server.net.auth.seat_owners import SeatOwners
from race_server.net.auth.settings import ListenSettings, server_settings
from race_server.net.transport.link import Link, open_session
from race_server.net.wire import topics
from race_server.net.wire.topics import Topic, key_of

# Limit of waiting controls of a seat; more displace the oldest. More than one, so that a bad
# message after a good control does not hide it.
MOST_INPUTS = 8
# A silent driver may log in a second time from and until these times [s]: its link has stalled.
STALLED_S, GIVEN_UP_S = 2.0, 30.0
_WITHOUT_BADGE = {
    topics.CONTROL: "control without the seat's badge",
    topics.POSE: "pose without the seat's badge",
}
# More unanswered requests on one key are dropped; the client then times out.
MOST_QUERIES = 8
# Limit of requests answered per tick; the others wait.
MOST_ANSWERS = 8


@dataclass(frozen=True)
class Request:
    """A query that waits for an answer."""

    topic: Topic
    seat: int  # in the key, of the sender; -1 where the key has none
    payload: bytes
    _query: Any

    def answer(self, payload: bytes) -> None:
        """Send the answer and end the query."""
        with suppress(zenoh.ZError):  # the client has disconnected
            self._query.reply(self._query.key_expr, payload)
        self._query.drop()


class ServerLink(Link):
    """The end of the server: receives from all seats, publishes to all clients."""

    def __init__(
        self,
        address: str,
        session_name: str,
        seats: int,
        *,
        keys: ServerKeys | None = None,
        real_time: bool = False,
    ) -> None:
        """Listen on `address`.

        keys: without them it listens to this machine only. real_time: limits the rate of controls,
        of which one per tick is enough.

        Raises:
            LinkError: it cannot listen there, or would be open to all machines.
            WireError: the session's name is not valid.
        """
        key_of(topics.SNAPSHOT, session_name)
        settings = server_settings(ListenSettings(address, session_name, seats, keys, real_time))
        try:
            super().__init__(open_session(settings))
        except zenoh.ZError as error:
            raise LinkError(
                f"cannot listen on {address}: it is in use or not of this machine; "
                "choose another address with --listen, such as tcp/127.0.0.1:7448"
            ) from error
        self.address = address
        self.holders = SeatOwners(seats)
        self.is_open = keys is not None
        self.dropped: Counter[tuple[str, int]] = Counter()  # by reason and seat
        self._name = session_name
        self._inputs: list[deque[bytes]] = [deque(maxlen=MOST_INPUTS) for _ in range(seats)]
        self._poses: list[deque[tuple[bytes, int]]] = [
            deque(maxlen=MOST_INPUTS) for _ in range(seats)
        ]
        self._seats = {str(seat): seat for seat in range(seats)}  # as written in keys
        self._last_message_s = [-math.inf] * seats  # when each seat's owner last sent
        self._arrived = threading.Event()
        self._requests: dict[str, deque[Request]] = {}
        self._turn = 0  # where the next round of answers starts
        self._publishers: dict[tuple[str, int], Any] = {}
        self._karts: dict[int, Any] = {}  # subscribers to the poses of real karts, by seat
        # In real time controls wait in rings of zenoh until the loop takes them: no Python runs as
        # they arrive, so a flood does not compete with the loop for the interpreter.
        self._rings: list[tuple[Any, Callable[[Any], None]]] = []
        self._kept: list[Any] = [self._receive_seat(seat, real_time) for seat in range(seats)]
        self._kept += [self._receive_queries(topic) for topic in topics.QUERIES]
        self._kept.append(self._watch_presence())
        self._kept.append(self._watch_links())

    def _counted(self, store: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback whose failures are counted: zenoh only prints them."""

        def call(news: Any) -> None:
            try:
                store(news)
            except Exception:
                self.dropped["message that raised an error", -1] += 1

        return call

    def _receive_seat(self, seat: int, real_time: bool) -> Any:
        store = self._keeper(topics.CONTROL, seat, self._inputs[seat].append)
        if not real_time:
            return self._subscribe(topics.CONTROL, seat, store)
        ring: Any = zenoh.handlers.RingChannel(MOST_INPUTS)
        subscriber = self._subscribe(topics.CONTROL, seat, ring)
        self._rings.append((subscriber, store))
        return subscriber

    def _receive_kart(self, seat: int) -> Any:
        mailbox = self._poses[seat]

        def note(data: bytes) -> None:
            mailbox.append((data, time.monotonic_ns() // 1000))

        return self._subscribe(topics.POSE, seat, self._keeper(topics.POSE, seat, note))

    def _keeper(
        self, topic: Topic, seat: int, keep: Callable[[bytes], None]
    ) -> Callable[[Any], None]:
        """Return a callback that keeps messages with the badge of their seat's owner."""

        def store(sample: zenoh.Sample) -> None:
            badge = sample.attachment
            if badge is None or not self.holders.is_holder(seat, badge.to_bytes()):
                self.dropped[_WITHOUT_BADGE[topic], seat] += 1
                return
            if len(sample.payload) > topic.most_bytes:
                self.dropped["oversized", seat] += 1
                return
            data = sample.payload.to_bytes()
            if data[4:8] != topic.identifier:
                self.dropped["foreign", seat] += 1
                return
            keep(data)
            self._last_message_s[seat] = time.monotonic()
            self._arrived.set()

        return self._counted(store)

    def _subscribe(self, topic: Topic, seat: int, handler: Any) -> Any:
        key = key_of(topic, self._name, seat)
        return self._session.declare_subscriber(key, handler, allowed_origin=zenoh.Locality.REMOTE)

    def _receive_queries(self, topic: Topic) -> Any:
        def store(query: zenoh.Query) -> None:
            key = str(query.key_expr)
            seat = self._seat_in(topic, key)
            if seat is None:
                self.dropped["request on an unknown key", -1] += 1
                return
            payload = query.payload.to_bytes() if query.payload is not None else b""
            if len(payload) > topic.most_bytes:
                self.dropped["oversized", seat] += 1
                return
            waiting = self._requests.setdefault(key, deque())
            if len(waiting) >= MOST_QUERIES:
                self.dropped["too many requests", seat] += 1
                return
            waiting.append(Request(topic, seat, payload, query))
            self._arrived.set()

        key = key_of(topic, self._name, topics.EVERY)
        return self._session.declare_queryable(key, self._counted(store), complete=True)

    def _seat_in(self, topic: Topic, key: str) -> int | None:
        """Return the seat in a key, -1 for none; None for a key of another topic."""
        if not topic.is_seats:
            return -1 if key == key_of(topic, self._name) else None
        place = key.rsplit("/", 1)[1]
        return -1 if place == topics.ANY else self._seats.get(place)

    def _watch_presence(self) -> Any:
        def store(sample: zenoh.Sample) -> None:
            *_, place, badge = str(sample.key_expr).split("/")
            seat, is_there = self._seats.get(place), sample.kind == zenoh.SampleKind.PUT
            if seat is None:
                return
            if not self.holders.note_link(seat, badge.encode(), is_there=is_there):
                self.dropped["second login", seat] += 1
            self._arrived.set()

        key = key_of(topics.ALIVE, self._name, topics.EVERY)
        return self._session.liveliness().declare_subscriber(
            key, self._counted(store), history=True
        )

    def _watch_links(self) -> Any:
        """Count second logins of a certificate: a stolen one may only listen."""
        open_links: Counter[str] = Counter()
        owners = {
            common_name(self._name, seat_name(seat)): seat for seat in range(len(self._inputs))
        }

        def store(event: zenoh.LinkEvent) -> None:
            name = event.link.auth_identifier
            if name in owners:
                is_new = event.kind == zenoh.SampleKind.PUT
                open_links[name] += 1 if is_new else -1
                silent_s = time.monotonic() - self._last_message_s[owners[name]]
                has_stalled = STALLED_S < silent_s < GIVEN_UP_S
                if is_new and open_links[name] > 1 and not has_stalled:
                    self.dropped["second login", owners[name]] += 1

        return self._session.info.declare_link_events_listener(self._counted(store), history=True)

    def take_inputs(self) -> list[tuple[int, bytes]]:
        """Return the newest controls of each seat since the last call, oldest first."""
        self._arrived.clear()
        for subscriber, store in self._rings:
            for _ in range(MOST_INPUTS):
                if (sample := subscriber.try_recv()) is None:
                    break
                store(sample)
        found = []
        for seat, mailbox in enumerate(self._inputs):
            while mailbox:
                found.append((seat, mailbox.popleft()))
        return found

    def hear_karts(self, seats: Collection[int]) -> None:
        """Receive poses of these seats and no others, so that the others cannot be flooded."""
        for seat in seats:
            if seat not in self._karts:
                self._karts[seat] = self._receive_kart(seat)
        for seat in self._karts.keys() - set(seats):
            self._karts.pop(seat).undeclare()
            self._poses[seat].clear()

    def take_poses(self) -> list[tuple[int, bytes, int]]:
        """Return the newest poses of each seat since the last call, oldest first.

        The third number is when each arrived [µs] by `time.monotonic`.
        """
        found = []
        for seat, mailbox in enumerate(self._poses):
            while mailbox:
                found.append((seat, *mailbox.popleft()))
        return found

    def take_requests(self) -> Iterable[Request]:
        """Yield requests that wait for an answer, one of each key in turn, a bounded number."""
        waiting = [requests for requests in list(self._requests.values()) if requests]
        self._turn += 1
        for place in range(min(len(waiting), MOST_ANSWERS)):
            yield waiting[(place + self._turn * MOST_ANSWERS) % len(waiting)].popleft()

    def take_presence(self) -> Iterable[tuple[int, bool]]:
        """Yield seats whose driver's link opened (True) or closed (False)."""
        while self.holders.news:
            yield self.holders.news.popleft()

    def overhear(self, store: Callable[[str, bytes], None]) -> None:
        """Call `store` with key and payload of every message from outside."""

        def receive(sample: zenoh.Sample) -> None:
            store(str(sample.key_expr), sample.payload.to_bytes())

        remote = zenoh.Locality.REMOTE
        self._kept.append(self._session.declare_subscriber("**", receive, allowed_origin=remote))

    def clients(self) -> int:
        """Return the count of open links."""
        return len(self._session.info.transports())

    def wait(self, timeout_s: float) -> bool:
        """Return True once a message has arrived since `take_inputs`, False at the timeout."""
        return self._arrived.wait(timeout_s)

    def publish(self, topic: Topic, payload: bytes, seat: int = -1) -> None:
        """Send a message to all subscribers of the topic."""
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
