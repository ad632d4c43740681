"""What is sent to browsers: to one, with what waits for it, and to all that see the same source."""

import time
from collections import deque
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Protocol

from race_server.core.clock import TICKS_PER_SECOND
from race_server.errors import GatewayError
from race_server.live.gateway.frames import frame_of
from race_server.live.gateway.limits import GatewayLimits

# Kinds of messages of which only the newest counts.
SNAPSHOT, STANDINGS, LINKS, LOT, ALERTS = "snapshot", "standings", "links", "lot", "alerts"
TELEMETRY, PROGRAMME, GHOSTS = "telemetry", "programme", "ghosts"
RAYS, HUD, OWN_POSE, OWN_ALERT, POSITION = "rays", "hud", "own pose", "own alert", "position"
HINT = "hint"


class FrameSink(Protocol):
    """A connection that takes frames."""

    on_writable: Callable[[], None] | None  # is called when there is room again

    @property
    def is_open(self) -> bool:
        """Whether frames are still sent."""

    @property
    def is_writable(self) -> bool:
        """Whether there is room for another frame."""

    def put(self, frame: bytes) -> None:
        """Send a frame."""

    def on_admitted(self) -> None:
        """Count as a browser from now on."""


class Outbox:
    """Sends at once while a browser reads; else keeps all that must arrive, and the newest rest."""

    def __init__(self, connection: FrameSink, limits: GatewayLimits, unread_s: float) -> None:
        """Send over a connection. unread_s: a browser may read nothing for this long [s]."""
        self.connection = connection
        self._most_waiting, self._unread_s = limits.waiting_messages, unread_s
        self._waiting: deque[bytes] = deque()
        self._newest: dict[str, bytes] = {}  # by kind
        self._stuck_since: float | None = None
        self.skipped = 0  # messages that a newer one replaced
        self.sent = 0
        connection.on_writable = self._drain

    def send(self, payload: bytes | str) -> None:
        """Send a message that must arrive."""
        self.send_frame(frame_of(payload))

    def send_frame(self, frame: bytes) -> None:
        """Send a frame that must arrive."""
        if self._is_free():
            self._write(frame)
        elif len(self._waiting) <= self._most_waiting:
            self._waiting.append(frame)

    def send_newest(self, kind: str, frame: bytes) -> None:
        """Send a frame, unless a newer one of its kind comes before there is room."""
        if self._is_free() and not self._newest:
            self._write(frame)
        else:
            self.skipped += kind in self._newest
            self._newest[kind] = frame

    def drop_newest(self) -> None:
        """Send nothing any more of what only its newest message counts: none of it does."""
        self._newest.clear()

    def check(self) -> None:
        """Do nothing for a browser that reads.

        Raises:
            GatewayError: it has read nothing for too long, or too much waits for it.
        """
        if len(self._waiting) > self._most_waiting:
            raise GatewayError(
                "slow", f"more than {self._most_waiting} messages wait for this browser"
            )
        since = self._stuck_since
        if since is not None and time.monotonic() - since > self._unread_s:
            raise GatewayError("slow", f"this browser has read nothing for {self._unread_s:g} s")

    def _is_free(self) -> bool:
        return not self._waiting and self.connection.is_writable

    def _write(self, frame: bytes) -> None:
        if not self.connection.is_open:
            return
        self.connection.put(frame)
        self.sent += 1
        if not self.connection.is_writable and self._stuck_since is None:
            self._stuck_since = time.monotonic()

    def _drain(self) -> None:
        """Send what waits while there is room: first what must arrive."""
        self._stuck_since = None
        while self.connection.is_writable and (self._waiting or self._newest):
            if self._waiting:
                frame = self._waiting.popleft()
            else:
                frame = self._newest.pop(next(iter(self._newest)))
            self._write(frame)
        if not self.connection.is_open:
            self._waiting.clear()
            self._newest.clear()


@dataclass(eq=False)
class Viewer:
    """What one browser sees, and how often."""

    outbox: Outbox
    rate: float  # [1/s] snapshots at most
    seat: int = -1  # the kart that it follows
    wants_rays: bool = False
    _due: float = field(default=0.0)  # tick of the next snapshot

    def send_snapshot(self, tick: int, frame: bytes, *, is_news: bool = False) -> None:
        """Send a snapshot, if one is due or it is news: after the last of a race none comes."""
        period = TICKS_PER_SECOND / self.rate
        early = self._due - tick
        if 0.0 < early <= period and not is_news:
            return
        # On time the period is kept exactly; after a gap, or when ticks go back, it starts again.
        self._due = self._due + period if -period < early <= 0.0 else tick + period
        self.outbox.send_newest(SNAPSHOT, frame)


class Audience:
    """All viewers of one source."""

    def __init__(self) -> None:
        """Begin with none."""
        self._viewers: set[Viewer] = set()

    def __iter__(self) -> Iterator[Viewer]:
        return iter(self._viewers)

    def __len__(self) -> int:
        return len(self._viewers)

    def add(self, viewer: Viewer) -> None:
        """Add a viewer."""
        self._viewers.add(viewer)

    def remove(self, viewer: Viewer) -> None:
        """Remove a viewer, if it is there."""
        self._viewers.discard(viewer)

    def publish(self, frame: bytes) -> None:
        """Send a frame that must arrive to all."""
        for viewer in self._viewers:
            viewer.outbox.send_frame(frame)

    def publish_newest(self, kind: str, frame: bytes) -> None:
        """Send a frame of a kind of which only the newest counts to all."""
        for viewer in self._viewers:
            viewer.outbox.send_newest(kind, frame)

    def publish_snapshot(self, tick: int, frame: bytes, *, is_news: bool) -> None:
        """Send a snapshot to all for whom one is due; one that is news, to all."""
        for viewer in self._viewers:
            viewer.send_snapshot(tick, frame, is_news=is_news)
