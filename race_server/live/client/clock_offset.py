"""How old a message is, where sender and receiver have different clocks."""

# The quickest message counts for at most two windows of this length [s]: clocks drift.
WINDOW_S = 30.0


class ClockOffset:
    """How far a sender's clock is behind ours, from one-way messages alone.

    The quickest recent message was hardly delayed, so its travel time counts as the offset; half of
    the shortest round trip known is added as the least time that a message takes.
    """

    def __init__(self) -> None:
        """Begin without any message."""
        self._way = float("inf")
        self.restart()

    def restart(self) -> None:
        """Forget the sender's clock, but not how far away it is: the clock has been reset."""
        self._least = self._before = float("inf")  # of this window and of the one before
        self._begun = float("-inf")

    @property
    def offset_s(self) -> float:
        """Our clock minus the sender's [s], by the quickest message."""
        return min(self._least, self._before)

    def record(self, sent_s: float, received_s: float) -> None:
        """Record a message, sent by the sender's clock and received by ours [s]."""
        if received_s - self._begun > WINDOW_S:
            self._before, self._least, self._begun = self._least, float("inf"), received_s
        self._least = min(self._least, received_s - sent_s)

    def record_round_trip(self, seconds: float) -> None:
        """Record how long a request and its answer took together [s]."""
        self._way = min(self._way, 0.5 * seconds)

    def age_s(self, sent_s: float, now_s: float) -> float:
        """Return how old [s] a message of the sender is at `now_s` of our clock."""
        way = self._way if self._way < float("inf") else 0.0
        return max(now_s - sent_s - self.offset_s, 0.0) + way
