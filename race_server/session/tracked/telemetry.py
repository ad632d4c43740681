"""How real karts are, as long as they go on saying it."""

from dataclasses import dataclass, field

from race_server.core.clock import MICROSECONDS
from race_server.core.telemetry import Telemetry
from race_server.errors import Reason, WireError

# A kart tells five times a second how it is; after this time without [s] it is not known.
KEPT_S = 2.0


@dataclass
class KartTelemetry:
    """The newest telemetry of each real kart."""

    by_seat: dict[int, Telemetry] = field(default_factory=dict)
    _arrived_us: dict[int, int] = field(default_factory=dict)
    _sequences: dict[int, int] = field(default_factory=dict)
    _has_news: bool = False

    def receive(self, seat: int, sequence: int, told: Telemetry, arrived_us: int) -> None:
        """Receive how a kart is.

        Raises:
            WireError: it is a replay.
        """
        if sequence <= self._sequences.get(seat, 0):
            raise WireError(f"telemetry {sequence} of seat {seat} again", Reason.AGAIN)
        self._sequences[seat], self._arrived_us[seat] = sequence, arrived_us
        self.by_seat[seat], self._has_news = told, True

    def has_news(self, now_us: int) -> bool:
        """Return whether anything changed since the last call; what was not repeated is over."""
        for seat in [*self.by_seat]:
            if now_us - self._arrived_us[seat] > KEPT_S * MICROSECONDS:
                del self.by_seat[seat]
                self._has_news = True
        news, self._has_news = self._has_news, False
        return news

    def forget(self, seat: int) -> None:
        """Forget a kart that has left."""
        self._has_news |= self.by_seat.pop(seat, None) is not None
        self._sequences.pop(seat, None)
