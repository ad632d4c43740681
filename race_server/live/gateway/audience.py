"""Everybody who watches the same source."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from race_server.core.clock import TICKS_PER_SECOND
from race_server.live.gateway.outbox import Outbox

# Kinds of which only the newest counts.
SNAPSHOT, STANDINGS, LINKS, RAYS, HUD, POSITION = (
    *("snapshot", "standings", "links", "rays"),
    *("hud", "position"),
)


@dataclass(eq=False)
class Viewer:
    """What one browser wants to see, and how often."""

    outbox: Outbox
    rate: float  # [1/s] at most so many snapshots
    seat: int = -1  # the kart that it follows
    wants_rays: bool = False
    _due: float = field(default=0.0)  # tick of the next snapshot

    def show_snapshot(self, tick: int, frame: bytes) -> None:
        """Send a snapshot, if it is time for one."""
        period = TICKS_PER_SECOND / self.rate
        early = self._due - tick
        if 0.0 < early <= period:
            return
        # In step where it is on time; anew after a gap, or when ticks begin again.
        self._due = self._due + period if -period < early <= 0.0 else tick + period
        self.outbox.show(SNAPSHOT, frame)


class Audience:
    """A set of viewers."""

    def __init__(self) -> None:
        """Begin with none."""
        self._viewers: set[Viewer] = set()

    def __iter__(self) -> Iterator[Viewer]:
        return iter(self._viewers)

    def __len__(self) -> int:
        return len(self._viewers)

    def join(self, viewer: Viewer) -> None:
        """Let somebody in."""
        self._viewers.add(viewer)

    def leave(self, viewer: Viewer) -> None:
        """Let somebody go."""
        self._viewers.discard(viewer)

    def put(self, frame: bytes) -> None:
        """Send everybody a frame that must arrive."""
        for viewer in self._viewers:
            viewer.outbox.put(frame)

    def show(self, kind: str, frame: bytes) -> None:
        """Send everybody a frame of a kind of which the newest counts."""
        for viewer in self._viewers:
            viewer.outbox.show(kind, frame)

    def show_snapshot(self, tick: int, frame: bytes) -> None:
        """Send a snapshot to everybody whose turn it is."""
        for viewer in self._viewers:
            viewer.show_snapshot(tick, frame)
