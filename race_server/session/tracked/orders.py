"""What a real kart must obey, and whether it says that it does."""

from dataclasses import dataclass

from race_server.core.clock import MICROSECONDS

# A kart that does not acknowledge its orders for this long cannot be relied on.
DEAF_S = 1.5
# More orders than a killed server can have given without writing them.
UNWRITTEN = 3600


@dataclass
class Orders:
    """What a kart must obey, numbered, and how far it has acknowledged that."""

    sequence: int = 0
    acknowledged: int = 0
    _what: tuple[float, ...] = ()
    _since_us: int = 0

    def resumed(self, now_us: int) -> "Orders":
        """Return the orders for the rest of a race whose server was killed: all are repeated.

        Their numbers are higher than any that the kart may have received unrecorded.
        """
        return Orders(self.sequence + UNWRITTEN, self.acknowledged, _since_us=now_us)

    def change(self, what: tuple[float, ...], now_us: int) -> None:
        """Give the orders a new number if they are others than before."""
        if what != self._what:
            if self.acknowledged == self.sequence:
                self._since_us = now_us
            self._what = what
            self.sequence += 1

    def acknowledge(self, sequence: int, now_us: int) -> None:
        """Record what the kart says it obeys."""
        if self.acknowledged < sequence <= self.sequence:
            self.acknowledged = sequence
            self._since_us = now_us

    @property
    def is_open(self) -> bool:
        """Whether the newest orders are not acknowledged yet."""
        return self.acknowledged < self.sequence

    def is_unheard(self, now_us: int) -> bool:
        """Return whether no order was acknowledged for too long."""
        return self.is_open and now_us - self._since_us > DEAF_S * MICROSECONDS
