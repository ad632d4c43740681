"""What real karts say that they see and do, as long as they go on saying it."""

from dataclasses import dataclass, field

from race_server.core.alert import Alert, DangerStage
from race_server.core.clock import MICROSECONDS
from race_server.errors import Reason, WireError

# A kart repeats what it says five times a second; after this time without [s] it holds no more.
KEPT_S = 1.0


@dataclass
class KartAlerts:
    """The newest alert of each real kart that has anything to say."""

    by_seat: dict[int, Alert] = field(default_factory=dict)
    _arrived_us: dict[int, int] = field(default_factory=dict)
    _sequences: dict[int, int] = field(default_factory=dict)
    _has_news: bool = False

    def receive(self, seat: int, sequence: int, alert: Alert, arrived_us: int) -> None:
        """Receive an alert.

        Raises:
            WireError: it is a replay.
        """
        if sequence <= self._sequences.get(seat, 0):
            raise WireError(f"alert {sequence} of seat {seat} again", Reason.AGAIN)
        self._sequences[seat], self._arrived_us[seat] = sequence, arrived_us
        says_something = alert.danger.stage > DangerStage.NONE
        self._has_news |= says_something or seat in self.by_seat
        if says_something:
            self.by_seat[seat] = alert
        else:
            self.by_seat.pop(seat, None)

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
