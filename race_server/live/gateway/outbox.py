"""What waits for one browser: of some kinds only the newest, of others all, up to a bound."""

import time
from collections import deque

from race_server.errors import GatewayError
from race_server.live.gateway.connection import WebSocketConnection, frame_of
from race_server.live.gateway.limits import DRAIN_S

# Messages that must all arrive; more wait for nobody.
MOST_WAITING = 256


class Outbox:
    """Sends at once while the browser reads, and keeps what counts while it does not."""

    def __init__(self, pipe: WebSocketConnection) -> None:
        """Send into a pipe."""
        self.pipe = pipe
        self._waiting: deque[bytes] = deque()
        self._newest: dict[str, bytes] = {}  # by kind
        self._stuck_since: float | None = None
        self.skipped = 0  # messages that a newer one replaced
        self.sent = 0
        pipe.on_writable = self._drain

    def tell(self, payload: bytes | str) -> None:
        """Send a message that must arrive."""
        self.put(frame_of(payload))

    def put(self, frame: bytes) -> None:
        """Send a frame that must arrive."""
        if self._is_free():
            self._send(frame)
        elif len(self._waiting) <= MOST_WAITING:
            self._waiting.append(frame)

    def show(self, kind: str, frame: bytes) -> None:
        """Send a frame, unless a newer one of its kind comes before there is room."""
        if self._is_free() and not self._newest:
            self._send(frame)
        else:
            self.skipped += kind in self._newest
            self._newest[kind] = frame

    def check(self) -> None:
        """Do nothing for a browser that reads.

        Raises:
            GatewayError: it has read nothing for too long, or too much waits for it.
        """
        if len(self._waiting) > MOST_WAITING:
            raise GatewayError("slow", f"more than {MOST_WAITING} messages wait for this browser")
        since = self._stuck_since
        if since is not None and time.monotonic() - since > DRAIN_S:
            raise GatewayError("slow", f"this browser has read nothing for {DRAIN_S:g} s")

    def _is_free(self) -> bool:
        return not self._waiting and self.pipe.is_writable

    def _send(self, frame: bytes) -> None:
        if not self.pipe.is_open:
            return
        self.pipe.put(frame)
        self.sent += 1
        if not self.pipe.is_writable and self._stuck_since is None:
            self._stuck_since = time.monotonic()

    def _drain(self) -> None:
        """Send what waits, as long as there is room: first what must arrive."""
        self._stuck_since = None
        while self.pipe.is_writable and (self._waiting or self._newest):
            if self._waiting:
                frame = self._waiting.popleft()
            else:
                frame = self._newest.pop(next(iter(self._newest)))
            self._send(frame)
        if not self.pipe.is_open:
            self._waiting.clear()
            self._newest.clear()
