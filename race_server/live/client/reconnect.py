"""A fresh link for a driver whose old one has stalled.

Where packet after packet is lost TCP waits twice as long before it tries again, each time: a link
may be there and carry nothing for twenty seconds. A fresh one is through within a few seconds, and
the server takes who shows the same secret on it for the same driver.
"""

import threading
import time
from collections.abc import Callable
from functools import partial
from typing import Self

from race_server.errors import RaceError
from race_server.live.client.seat import ClientSeat, insist, take_seat
from race_server.net.transport import ClientLink

# A fresh link that is not through after so long will not be: another one is tried.
FRESH_LINK_S = 5.0


class Reconnect:
    """Moves a seat to a fresh link, while its driver goes on listening to the old one."""

    def __init__(
        self,
        seat: ClientSeat,
        connect: Callable[[], ClientLink],
        prepare: Callable[[ClientLink, float], None],
    ) -> None:
        """Stand by.

        connect: returns a fresh link, or raises. prepare: is called with it, and the time of
        `time.monotonic` until which it may take, before the seat moves there.
        """
        self._seat = seat
        self._connect = connect
        self._prepare = prepare
        self._fresh: ClientSeat | None = None
        self._attempt: threading.Thread | None = None

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End the seat's links."""
        if self._attempt is not None:
            self._attempt.join()
        self.end()
        self._seat.link.close()

    def begin(self) -> bool:
        """Ask for the seat over a fresh link; False where that is under way."""
        if self._attempt is not None:
            return False
        self._attempt = threading.Thread(target=self._renew, name="fresh link")
        self._attempt.start()
        return True

    def end(self) -> bool:
        """Return whether the seat has moved to a fresh link just now; the old one ends then."""
        if self._attempt is None or self._attempt.is_alive():
            return False
        self._attempt = None
        fresh, self._fresh = self._fresh, None
        if fresh is None:
            return False
        # What a stalled link has still to send holds up who ends it.
        threading.Thread(target=self._seat.link.close, name="stalled link").start()
        self._seat.link, self._seat.send = fresh.link, fresh.send
        return True

    def _renew(self) -> None:
        try:
            link = self._connect()
        except RaceError:
            return  # the next silence asks again
        deadline = time.monotonic() + FRESH_LINK_S
        try:
            ask = partial(take_seat, link, self._seat.request, self._seat.mailbox)
            fresh = insist(ask, deadline)
            self._prepare(link, deadline)
        except RaceError:
            link.close()
            return
        self._fresh = fresh
