"""Requests that only the holder of a secret can make, each of which counts once."""

from collections.abc import Iterator
from dataclasses import dataclass, field

from race_server.errors import Reason, SeatError

# The last serials of at most this many senders are kept.
MOST_SERIALS = 1024


@dataclass(frozen=True, slots=True)
class Granted:
    """A request that was granted before a tick: a copy of it, or of one before, is refused."""

    tick: int
    key: bytes  # follows from the sender's secret
    serial: int


@dataclass
class ReplayGuard:
    """The serial of the last request of each sender."""

    last: dict[bytes, int] = field(default_factory=dict)

    def check(self, key: bytes, serial: int) -> None:
        """Do nothing for a request that is newer than all before.

        Raises:
            SeatError: it is not.
        """
        last = self.last.get(key, 0)
        if serial <= last:
            raise SeatError(
                f"request {serial} again: already at {last}, so this is a copy", Reason.AGAIN
            )

    def record(self, key: bytes, serial: int) -> None:
        """Record a request that was granted."""
        if key not in self.last and len(self.last) >= MOST_SERIALS:
            del self.last[next(iter(self.last))]
        self.last[key] = serial

    def granted(self, tick: int) -> Iterator[Granted]:
        """Yield the last request of each sender, as if it had been granted before a tick."""
        return (Granted(tick, key, serial) for key, serial in self.last.items())
