"""A new link for a driver whose old one has stalled.

Where packet after packet is lost TCP doubles the time until it tries again: a link may be open and
carry nothing for twenty seconds. A new one carries messages within a few seconds, and the server
accepts the same secret on it as the same driver.
"""

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Self

from race_server.errors import RaceError
from race_server.live.client.seat import ClientSeat, insist, take_seat
from race_server.net.transport import ClientLink


class Reconnect:
    """Moves a seat to a new link, while its driver goes on listening to the old one."""

    def __init__(
        self,
        seat: ClientSeat,
        connect: Callable[[], ClientLink],
        prepare: Callable[[ClientLink, float], None],
        timeout_s: float,
    ) -> None:
        """Prepare; nothing is connected before `begin`.

        connect: returns a new link, or raises. prepare: is called with it and with its deadline,
        a time of `time.monotonic`, before the seat moves there. timeout_s: for the whole attempt.
        """
        self._seat = seat
        self._connect = connect
        self._prepare = prepare
        self._timeout_s = timeout_s
        self._fresh: ClientSeat | None = None
        self._attempt: threading.Thread | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Close the seat's links."""
        if self._attempt is not None:
            self._attempt.join()
        self.finish()
        self._seat.link.close()

    def begin(self) -> bool:
        """Begin to move the seat to a new link; False where an attempt is under way."""
        if self._attempt is not None:
            return False
        self._attempt = threading.Thread(target=self._renew, name="fresh link")
        self._attempt.start()
        return True

    def finish(self) -> bool:
        """Move the seat if its new link is ready, and close the old one; return whether it did."""
        if self._attempt is None or self._attempt.is_alive():
            return False
        self._attempt = None
        fresh, self._fresh = self._fresh, None
        if fresh is None:
            return False
        # Closing a stalled link blocks until it has sent what it holds.
        threading.Thread(target=self._seat.link.close, name="stalled link").start()
        self._seat.link, self._seat.send = fresh.link, fresh.send
        return True

    def _renew(self) -> None:
        try:
            link = self._connect()
        except RaceError:
            return  # the next timeout tries again
        deadline = time.monotonic() + self._timeout_s
        try:
            seat = self._seat
            ask = partial(take_seat, link, seat.request, seat.mailbox, seat.orders)
            fresh = insist(ask, deadline)
            self._prepare(link, deadline)
        except RaceError:
            link.close()
            return
        self._fresh = fresh
