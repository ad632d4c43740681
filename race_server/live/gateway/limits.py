"""How much one browser, one address and all browsers together may ask for."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from race_server.errors import GatewayError

# All browsers, and those of one address that is not this machine.
MOST_BROWSERS, MOST_OF_ADDRESS = 256, 16
# A page, its files and its socket open a few connections each.
MOST_CONNECTIONS, MOST_CONNECTIONS_OF_ADDRESS = 1024, 64
# A browser says who it is within so long …
HELLO_S = 3.0
# … in so many bytes; later texts are as short, and so are controls.
MOST_TEXT, MOST_CONTROL = 1024, 256
# Longer messages end the connection before anybody has read them.
MOST_MESSAGE = 1 << 16
TEXTS_HZ, CONTROLS_HZ = 20.0, 120.0
# Of whatever it sends, pings and pieces too; and a message comes in so many pieces.
BYTES_HZ, MOST_PIECES = 1 << 17, 64
# Somebody whose network held messages up may send so many seconds' worth at once.
BURST_S = 2.0
# A browser that takes nothing for so long is let go, and ends for good a little later.
DRAIN_S, ABORT_S = 10.0, 3.0
HEARTBEAT_S = 20.0


@dataclass
class RateLimiter:
    """Fills up at a rate; each message, or byte, takes one from it."""

    rate_hz: float
    what: str
    clock: Callable[[], float] = time.monotonic
    _left: float = field(init=False)
    _at: float = field(init=False)

    def __post_init__(self) -> None:
        """Begin full."""
        self._left, self._at = BURST_S * self.rate_hz, self.clock()

    def spend(self, amount: float = 1.0) -> None:
        """Take one, or several.

        Raises:
            GatewayError: there are not so many left.
        """
        now = self.clock()
        self._left = min(self._left + (now - self._at) * self.rate_hz, BURST_S * self.rate_hz)
        self._at = now
        if self._left < amount:
            raise GatewayError(
                "too-fast", f"more than {self.rate_hz:g} {self.what} a second; send fewer"
            )
        self._left -= amount
