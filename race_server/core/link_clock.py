"""A real kart's clock, set against ours."""

import math
from collections import deque

from race_server.core.clock import MICROSECONDS


class LinkClock:
    """Sets a kart's clock against ours by the quickest messages of the last half minute.

    What a message takes at least is half the shortest time that the kart needed to answer one of
    ours, which the kart echoes; a kart that echoes nothing is taken to be as late as `assumed_s`.
    """

    BUCKET_US, BUCKETS = 3 * MICROSECONDS, 10
    # A clock that is this far off all at once was set again …
    RESET_US = 2 * MICROSECONDS
    # … and so was one by which this many messages in a row came before they were sent, or took
    # longer than their round trip, by more than this.
    MOST_WRONG, JITTER_US = 5, 50_000

    def __init__(self, assumed_s: float = 0.0) -> None:
        """Begin without any message."""
        self._assumed_us = assumed_s * MICROSECONDS
        # Of each bucket of time: its number, shortest arrival less stamp, shortest round trip, and
        # arrival less stamp of the message that made it.
        self._buckets: deque[list[float]] = deque(maxlen=self.BUCKETS)
        self._wrong = 0  # messages in a row that another clock must have stamped

    def record(self, stamp_us: int, arrived_us: int, echo_us: int = 0) -> None:
        """Record a message: stamped by the kart, arrived by our clock."""
        gap, trip = float(arrived_us - stamp_us), arrived_us - echo_us
        is_told = bool(echo_us) and 0 <= trip < self.RESET_US
        if is_told and self._quickest[0] < math.inf:
            took = gap - self.offset_us
            is_right = -self.JITTER_US <= took <= trip + self.JITTER_US
            self._wrong = 0 if is_right else self._wrong + 1
        is_far = bool(self._buckets) and abs(gap - self._gap_us) > self.RESET_US
        if is_far or self._wrong >= self.MOST_WRONG:
            self._buckets.clear()
            self._wrong = 0
        number = arrived_us // self.BUCKET_US
        if not self._buckets or self._buckets[-1][0] != number:
            self._buckets.append([number, gap, math.inf, gap])
        bucket = self._buckets[-1]
        bucket[1] = min(bucket[1], gap)
        if is_told and trip < bucket[2]:
            bucket[2:] = trip, gap

    @property
    def _gap_us(self) -> float:
        return min((bucket[1] for bucket in self._buckets), default=0.0)

    @property
    def _quickest(self) -> tuple[float, float]:
        """Round trip [µs] and arrival less stamp of the quickest answer."""
        rows = ((bucket[2], bucket[3]) for bucket in self._buckets)
        return min(rows, default=(math.inf, 0.0))

    @property
    def delay_us(self) -> float:
        """What a message takes at least [µs]."""
        trip, _ = self._quickest
        return 0.5 * trip if trip < math.inf else self._assumed_us

    @property
    def offset_us(self) -> float:
        """What to add to a stamp of the kart to have the time of our clock [µs]."""
        trip, gap = self._quickest
        return gap - 0.5 * trip if trip < math.inf else self._gap_us - self._assumed_us
