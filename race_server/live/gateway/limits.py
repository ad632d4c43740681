"""How much browsers may ask for, how long anything may take, and what counts it."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from race_server.errors import GatewayError


@dataclass(frozen=True)
class GatewayLimits:
    """Bounds on what browsers cost: counts, sizes [bytes] and rates [1/s]."""

    # Browsers, of all addresses and of one that is not this machine. An IPv6 address counts as its
    # network of 64 bits.
    browsers: int = 512
    browsers_per_address: int = 16
    # TCP connections that are no browser yet: a page and its files open a few each. Beyond these
    # the oldest idle one ends.
    connections: int = 1024
    connections_per_address: int = 64
    # Connections that wait to be accepted, and files that this process asks to open.
    backlog: int = 256
    open_files: int = 8192
    # A text and a control of a browser.
    text_bytes: int = 1024
    control_bytes: int = 256
    # Longer messages end the connection before they are read.
    message_bytes: int = 1 << 16
    texts_hz: float = 20.0
    controls_hz: float = 120.0
    # Protests of a driver: each is a decision that the race takes.
    protests_hz: float = 0.5
    # All that a browser sends, pings and fragments included.
    bytes_hz: float = 1 << 17
    # Fragments of one message.
    fragments: int = 64
    # After a break of the network a browser may send this many seconds' worth at once.
    burst_s: float = 2.0
    # Bytes that wait in this process for a browser that reads slowly; beyond that only the newest
    # message of a kind is kept. As much again may wait in the kernel.
    write_buffer_bytes: int = 16_384
    # Pongs and closing frames exceed that bound; a browser never causes this many bytes of them.
    buffered_bytes: int = 1 << 20
    # Messages that must all arrive and wait for one browser.
    waiting_messages: int = 256
    # Messages of the race that must all be processed and wait for the event loop.
    race_messages: int = 1024
    # Resume tokens that are valid at once, of each role.
    resume_tokens: int = 1024
    # Threads that wait for the race, and threads that read recordings.
    race_threads: int = 8
    recording_threads: int = 4
    # Recordings in the list, and recordings whose events stay in memory.
    listed_recordings: int = 100
    cached_recordings: int = 4


@dataclass(frozen=True)
class GatewayTiming:
    """Timeouts and periods of a gateway, in seconds."""

    # A browser authenticates within this time.
    hello_s: float = 3.0
    # A connection that has sent no whole request is closed after this time …
    first_request_s: float = 10.0
    # … and one that has not become a WebSocket, after this time.
    request_s: float = 60.0
    heartbeat_s: float = 20.0
    # A browser that has read nothing for this long is disconnected …
    unread_s: float = 10.0
    # … and its connection is aborted this long after the end of its session.
    abort_s: float = 3.0
    # A refused browser has this long to read the reason, and all browsers at the gateway's end.
    farewell_s: float = 1.0
    # A page shows the race this much late, so that it has two snapshots to interpolate between.
    page_delay_s: float = 0.1
    # Without a control for this long a driver's hands are off the controls.
    dead_man_s: float = 0.25
    # The seat of a driver whose page is gone is kept for this long.
    seat_grace_s: float = 30.0
    # A page that was silent for this long may be replaced by one that shows its resume token.
    stalled_s: float = 2.0
    # Without heads-up data for this long a seat is asked for again.
    hud_timeout_s: float = 3.0
    # A link to the race fails after this time.
    connect_s: float = 2.0
    # Between two attempts to connect to a race.
    reconnect_s: float = 0.5
    # Between two checks of the link to the race.
    link_poll_s: float = 0.5
    # A lobby sends nothing: after this silence it is asked whether it is there.
    race_silence_s: float = 1.5
    # A race that was there and has been gone for this long is over: a server that was killed is
    # back before that.
    race_gone_s: float = 10.0
    # Between two polls of the seats and rays, and between two checks for browsers that do not read.
    poll_s: float = 0.1
    check_s: float = 1.0
    # Between two positions of a recording that plays, and between two casts of its rays.
    position_s: float = 0.5
    rays_s: float = 0.1


@dataclass
class RateLimiter:
    """A token bucket: fills at a rate; each message, or byte, takes one from it."""

    rate_hz: float
    what: str
    burst_s: float  # what it holds, in seconds of its rate
    clock: Callable[[], float] = time.monotonic
    _left: float = field(init=False)
    _at: float = field(init=False)

    def __post_init__(self) -> None:
        """Begin full."""
        self._left, self._at = self.burst_s * self.rate_hz, self.clock()

    def spend(self, amount: float = 1.0) -> None:
        """Take one, or several.

        Raises:
            GatewayError: fewer are left.
        """
        now = self.clock()
        full = self.burst_s * self.rate_hz
        self._left = min(self._left + (now - self._at) * self.rate_hz, full)
        self._at = now
        if self._left < amount:
            raise GatewayError(
                "too-fast", f"more than {self.rate_hz:g} {self.what} a second; send fewer"
            )
        self._left -= amount
