"""The end of a real kart among the others: peers of one another, without a server."""

from collections.abc import Callable

import zenoh

from race_server.errors import LinkError
from race_server.net.auth.settings import SEATS, PeerSettings, peer_settings
from race_server.net.transport.link import Link, open_session
from race_server.net.wire import topics
from race_server.net.wire.topics import key_of

Store = Callable[[int, bytes], None]  # with a seat and its message; runs in a thread of zenoh


class PeerLink(Link):
    """Tells all peers of one kart, and hears each of them."""

    def __init__(self, settings: PeerSettings, store: Store) -> None:
        """Listen, and connect to each peer once it is there. store: takes each message.

        Raises:
            LinkError: the address cannot be listened on, or others could listen in.
            KeysError: the address requires a certificate.
            WireError: the session's name is not valid.
        """
        key = key_of(topics.PEER, settings.session, settings.seat)
        try:
            super().__init__(open_session(peer_settings(settings)))
        except zenoh.ZError as error:
            raise LinkError(
                f"cannot listen for other karts on {settings.address}: it is in use or not of "
                "this machine"
            ) from error
        self._publisher = self._session.declare_publisher(
            key,
            congestion_control=zenoh.CongestionControl.DROP,
            priority=zenoh.Priority.REAL_TIME,
            express=True,
        )
        seats = {str(seat): seat for seat in SEATS if seat != settings.seat}

        def receive(sample: zenoh.Sample) -> None:
            seat = seats.get(str(sample.key_expr).rsplit("/", 1)[1])
            if seat is not None and len(sample.payload) <= topics.PEER.most_bytes:
                store(seat, sample.payload.to_bytes())

        every = key_of(topics.PEER, settings.session, topics.EVERY)
        self._subscriber = self._session.declare_subscriber(
            every, receive, allowed_origin=zenoh.Locality.REMOTE
        )

    def tell(self, data: bytes) -> None:
        """Tell all peers."""
        self._publisher.put(data)
