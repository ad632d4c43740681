"""The server's end."""

import math
import threading
import time
from collections import Counter, deque
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import zenoh

from race_server.errors import LinkError, Reason
from race_server.net.auth.access import STEWARD, common_name, seat_name
from race_server.net.auth.keys import ServerKeys
from race_server.net.auth.seat_owners import SeatOwners
from race_server.net.auth.settings import (
    ListenSettings,
    is_encrypted,
    places_of,
    port_of,
    server_settings,
)
from race_server.net.transport.inputs import (
    Check,
    Inputs,
    QueuedInputs,
    RingInputs,
    Subscribe,
)
from race_server.net.transport.link import Link, open_session
from race_server.net.transport.link_limiter import LinkLimiter, LinkLimits
from race_server.net.wire import topics
from race_server.net.wire.topics import Topic, key_of

# A driver that falls silent may log in once more between these times: its link has stalled.
STALLED_S, GIVEN_UP_S = 2.0, 30.0
_WITHOUT_BADGE = {
    topics.CONTROL: Reason.CONTROL_BADGE,
    topics.POSE: Reason.POSE_BADGE,
    topics.ALERT: Reason.ALERT_BADGE,
    topics.TELEMETRY: Reason.TELEMETRY_BADGE,
}
# More unanswered requests on one key are dropped, and time out.
MOST_QUERIES = 8
# At most this many keys are answered at once; the others wait for the next tick.
MOST_ANSWERS = 8
# On keys that all clients ask on one answer is for this many of them: 960 a second, as many as 48
# sessions may ask for. As many as the second number wait.
MOST_SHARING, MOST_SHARED = 16, 64


@dataclass(frozen=True)
class Request:
    """A query that waits for an answer, or several that wait for the same one."""

    topic: Topic
    seat: int  # of the client, as the key names it; -1 where it names none
    payload: bytes
    queries: list[Any]

    def answer(self, payload: bytes) -> None:
        """Send the answer and end the query."""
        for query in self.queries:
            with suppress(zenoh.ZError):  # the client has gone
                query.reply(query.key_expr, payload)
            query.drop()


class ServerLink(Link):
    """The server's end: receives from all seats, publishes to them and to spectators."""

    def __init__(
        self,
        address: str,
        session_name: str,
        seats: int,
        *,
        keys: ServerKeys | None = None,
        real_time: bool = False,
        steward_address: str = "",
    ) -> None:
        """Listen on `address`.

        keys: without them only this machine is listened to. real_time: no driver needs more than
        one control a tick, so where a seat sends far more only the newest are received.
        steward_address: a second one, for the steward alone.

        Raises:
            LinkError: it cannot be listened on, or would be open to any machine.
            WireError: the session's name is none.
        """
        key_of(topics.SNAPSHOT, session_name)
        listening = ListenSettings(address, session_name, seats, keys, real_time, steward_address)
        settings = server_settings(listening)
        try:
            super().__init__(open_session(settings))
        except zenoh.ZError as error:
            raise LinkError(
                f"cannot listen on {' and '.join(a for a in (address, steward_address) if a)}: "
                "it is in use or not of this machine; "
                "choose another address with --listen, such as tcp/127.0.0.1:7448"
            ) from error
        self.address = address
        self.holders = SeatOwners(seats)
        self.is_open = keys is not None
        self.is_real_time = real_time
        self.dropped: Counter[tuple[Reason, int]] = Counter()  # by reason and seat
        self._name = session_name
        self._seats = {str(seat): seat for seat in range(seats)}  # as they stand in keys
        self._heard_s = [-math.inf] * seats  # when the newest message of each seat came
        self._arrived = threading.Event()
        self._requests: dict[str, deque[Request]] = {}
        self._turn = 0  # where the next round of answers begins
        self._publishers: dict[tuple[str, int], Any] = {}
        self._controls = [self._inputs_of(seat, real_time) for seat in range(seats)]
        self._tracked: dict[tuple[int, Topic], Inputs] = {}  # of real karts, by seat
        self._kept: list[Any] = [self._subscribe_queries(topic) for topic in topics.QUERIES]
        self._kept.append(self._subscribe_presence())
        self._owners = {common_name(session_name, seat_name(seat)): seat for seat in range(seats)}
        self._link_limiter = self._link_limiter_of(listening)
        self._kept.append(self._subscribe_links())

    def _counted(self, store: Callable[[Any], None]) -> Callable[[Any], None]:
        """Return a callback whose failures are counted: zenoh prints them and goes on."""

        def call(news: Any) -> None:
            try:
                store(news)
            except Exception:
                self.dropped[Reason.CALLBACK, -1] += 1

        return call

    def _inputs_of(self, seat: int, real_time: bool) -> Inputs:
        subscribe, check = self._subscriber(topics.CONTROL, seat), self._check(topics.CONTROL, seat)
        if real_time:
            return RingInputs(subscribe, check)
        return QueuedInputs(subscribe, check, self._arrived.set)

    def _subscriber(self, topic: Topic, seat: int) -> Subscribe:
        key, remote = key_of(topic, self._name, seat), zenoh.Locality.REMOTE

        def subscribe(handler: Any) -> Any:
            return self._session.declare_subscriber(key, handler, allowed_origin=remote)

        return subscribe

    def _check(self, topic: Topic, seat: int) -> Check:
        """Return what checks that a message shows the badge of its seat's holder."""

        def fault_of(sample: zenoh.Sample) -> Reason | None:
            badge = sample.attachment
            if badge is None or not self.holders.is_holder(seat, badge.to_bytes()):
                return _WITHOUT_BADGE[topic]
            return Reason.OVERSIZED if len(sample.payload) > topic.most_bytes else None

        def check(sample: zenoh.Sample) -> bytes | None:
            try:
                fault, data = fault_of(sample), b""
                if not fault:
                    data = sample.payload.to_bytes()
                    fault = Reason.FOREIGN if data[4:8] != topic.identifier else None
            except Exception:
                self.dropped[Reason.CALLBACK, -1] += 1
                return None
            if fault:
                self.dropped[fault, seat] += 1
                return None
            self._heard_s[seat] = time.monotonic()
            return data

        return check

    def _subscribe_queries(self, topic: Topic) -> Any:
        def store(query: zenoh.Query) -> None:
            key = str(query.key_expr)
            seat = self._seat_in(topic, key)
            if seat is None:
                self.dropped[Reason.UNKNOWN_KEY, -1] += 1
                return
            payload = query.payload.to_bytes() if query.payload is not None else b""
            if len(payload) > topic.most_bytes:
                self.dropped[Reason.OVERSIZED, seat] += 1
                return
            waiting = self._requests.setdefault(key, deque())
            if len(waiting) >= (MOST_SHARED if topic.is_shared else MOST_QUERIES):
                self.dropped[Reason.TOO_MANY, seat] += 1
                return
            waiting.append(Request(topic, seat, payload, [query]))
            self._arrived.set()

        key = key_of(topic, self._name, topics.EVERY)
        return self._session.declare_queryable(key, self._counted(store), complete=True)

    def _seat_in(self, topic: Topic, key: str) -> int | None:
        """Return the seat that a key names, -1 for none; None for a key that is not the topic's."""
        if not topic.is_seats:
            return -1 if key == key_of(topic, self._name) else None
        place = key.rsplit("/", 1)[1]
        return -1 if place == topics.ANY else self._seats.get(place)

    def _subscribe_presence(self) -> Any:
        def store(sample: zenoh.Sample) -> None:
            *_, place, badge = str(sample.key_expr).split("/")
            seat, is_there = self._seats.get(place), sample.kind == zenoh.SampleKind.PUT
            if seat is None:
                return
            if not self.holders.note_link(seat, badge.encode(), is_there=is_there):
                self.dropped[Reason.SECOND_LOGIN, seat] += 1
            self._arrived.set()

        key = key_of(topics.ALIVE, self._name, topics.EVERY)
        return self._session.liveliness().declare_subscriber(
            key, self._counted(store), history=True
        )

    def _subscribe_links(self) -> Any:
        """Count how often a certificate is logged in: a stolen one may only listen."""
        open_links: Counter[str] = Counter()
        owners = self._owners

        def store(event: zenoh.LinkEvent) -> None:
            if self._link_limiter:
                self._link_limiter.note(event)
            name = event.link.auth_identifier
            if name in owners:
                is_new = event.kind == zenoh.SampleKind.PUT
                open_links[name] += 1 if is_new else -1
                silent_s = time.monotonic() - self._heard_s[owners[name]]
                has_stalled = STALLED_S < silent_s < GIVEN_UP_S
                if is_new and open_links[name] > 1 and not has_stalled:
                    self.dropped[Reason.SECOND_LOGIN, owners[name]] += 1

        return self._session.info.declare_link_events_listener(self._counted(store), history=True)

    def _link_limiter_of(self, listening: ListenSettings) -> LinkLimiter | None:
        """Return what bounds the links of each certificate; without certificates none can."""
        if listening.keys is None or not is_encrypted(listening.address):
            return None

        def count(reason: Reason, name: str) -> None:
            self.dropped[reason, self._owners.get(name, -1)] += 1

        steward = listening.steward_address
        limits = LinkLimits(
            listening.keys,
            places_of(listening),
            common_name(self._name, STEWARD),
            port_of(listening.address),
            port_of(steward) if steward else 0,
        )
        return LinkLimiter(limits, count).open()

    def bar_seat(self, seat: int, *, is_barred: bool) -> None:
        """Close the links of a seat's keys for as long as it is barred."""
        if self._link_limiter:
            self._link_limiter.bar(common_name(self._name, seat_name(seat)), is_barred=is_barred)

    def revoked_seats(self) -> set[int]:
        """Return the seats whose keys have been revoked."""
        revoked = self._link_limiter.revoked if self._link_limiter else ()
        return {self._owners[name] for name in revoked if name in self._owners}

    def close(self) -> None:
        """Close the session; a second call does nothing."""
        if self._link_limiter:
            self._link_limiter.close()
            self._link_limiter = None
        super().close()

    def receive_controls(self) -> Iterator[tuple[int, bytes]]:
        """Yield the newest controls of each seat since the last call, oldest first."""
        self._arrived.clear()
        for seat, inputs in enumerate(self._controls):
            for data, _ in inputs.receive():
                yield seat, data

    def expect_tracked(self, seats: Collection[int]) -> None:
        """Receive from real karts on these seats and no others: no flood where none sits."""
        kinds = (topics.POSE, topics.ALERT, topics.TELEMETRY)
        wanted = {(seat, topic) for seat in seats for topic in kinds}
        for seat, topic in wanted - self._tracked.keys():
            inputs = self._subscriber(topic, seat), self._check(topic, seat)
            self._tracked[seat, topic] = QueuedInputs(*inputs, self._arrived.set)
        for key in self._tracked.keys() - wanted:
            self._tracked.pop(key).close()

    def receive_tracked(self, topic: Topic) -> Iterator[tuple[int, bytes, int]]:
        """Yield the newest messages of each real kart since the last call, oldest first.

        topic: of poses, alerts or telemetry. The third number is when each arrived [µs] by
        `time.monotonic`.
        """
        for seat in sorted(seat for seat, kind in self._tracked if kind is topic):
            for data, arrived_us in self._tracked[seat, topic].receive():
                yield seat, data, arrived_us

    def receive_requests(self) -> Iterable[Request]:
        """Yield requests that wait for an answer, one of each key in turn, a bounded number."""
        waiting = [requests for requests in list(self._requests.values()) if requests]
        self._turn += 1
        for place in range(min(len(waiting), MOST_ANSWERS)):
            requests = waiting[(place + self._turn * MOST_ANSWERS) % len(waiting)]
            first = requests.popleft()
            sharing = min(len(requests), MOST_SHARING - 1) if first.topic.is_shared else 0
            queries = [query for _ in range(sharing) for query in requests.popleft().queries]
            yield replace(first, queries=first.queries + queries)

    def receive_presence(self) -> Iterable[tuple[int, bool]]:
        """Yield seats whose driver's link has come (True) or gone (False)."""
        while self.holders.news:
            yield self.holders.news.popleft()

    def receive_everything(self, store: Callable[[str, bytes], None]) -> None:
        """Call `store` with key and payload of each message that reaches this session."""

        def receive(sample: zenoh.Sample) -> None:
            store(str(sample.key_expr), sample.payload.to_bytes())

        remote = zenoh.Locality.REMOTE
        self._kept.append(self._session.declare_subscriber("**", receive, allowed_origin=remote))

    def clients(self) -> int:
        """Return how many links of others are open."""
        return len(self._session.info.transports())

    def wait(self, timeout_s: float) -> bool:
        """Return True once something has arrived since `receive_controls`, False at the timeout."""
        return self._arrived.wait(timeout_s)

    def publish(self, topic: Topic, payload: bytes, seat: int = -1) -> None:
        """Send a message to all subscribers of a topic."""
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
