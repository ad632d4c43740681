"""How a server is doing, in plain numbers: the loop writes them, other threads read them."""

import time
from bisect import bisect_left
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field

from race_server.core.clock import TICK_S
from race_server.errors import Reason
from race_server.logs import Log, RefusalLog
from race_server.session.seats import Seat

# Upper ends of the bins [s]; a tick lasts 16.7 ms.
DURATIONS = (0.0005, 0.001, 0.002, 0.003, 0.004, 0.006, 0.008, 0.012, TICK_S, 0.033, 0.1)
LATENESSES = (0.00002, 0.00005, 0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.004, 0.008, TICK_S, 0.1)


@dataclass
class Histogram:
    """Counts of times by bin; the last bin has no end."""

    ends: tuple[float, ...]  # [s]
    counts: list[int] = field(init=False)
    total: float = 0.0  # [s]

    def __post_init__(self) -> None:
        """Begin with empty bins."""
        self.counts = [0] * (len(self.ends) + 1)

    def record(self, seconds: float) -> None:
        """Count a time."""
        self.counts[bisect_left(self.ends, seconds)] += 1
        self.total += seconds


class Refusals(Counter[Reason]):
    """How many messages were refused, by reason."""

    def __init__(self, log: Log | None = None) -> None:
        """Count from nothing. log: receives the first of each reason and seat, and sums."""
        super().__init__()
        self._log = RefusalLog(log) if log else None
        self._seen: Counter[tuple[Reason, int]] = Counter()

    def record(self, reason: Reason, seat: int = -1, *, times: int = 1) -> None:
        """Count a refusal. seat: on whose key the message came, -1 for none."""
        self[reason] += times
        if self._log is not None:
            self._log.record(reason, seat, times=times, **({"seat": seat} if seat >= 0 else {}))

    def record_dropped(self, dropped: Counter[tuple[Reason, int]]) -> None:
        """Count what a link has dropped since the last call. dropped: by reason and seat."""
        for (reason, seat), total in list(dropped.items()):
            if new := total - self._seen[reason, seat]:
                self._seen[reason, seat] = total
                self.record(reason, seat, times=new)


@dataclass
class Counters:
    """All that the loop counts. It never waits here: readers may see one number before another."""

    seats: int
    refused: Refusals = field(default_factory=Refusals)
    duration: Histogram = field(default_factory=lambda: Histogram(DURATIONS))
    lateness: Histogram = field(default_factory=lambda: Histogram(LATENESSES))
    ticks: int = 0
    missed: int = 0
    controls: list[int] = field(init=False)  # of each seat, received
    lost: list[int] = field(init=False)  # of each seat, sent but never received
    silent: list[int] = field(init=False)  # of each seat, ticks without a fresh control
    turned_at: float = field(default_factory=time.monotonic)  # when the loop last came around

    def __post_init__(self) -> None:
        """Begin with zero for each seat."""
        self.controls, self.lost, self.silent = ([0] * self.seats for _ in range(3))

    def record_tick(self, duration_s: float, lateness_s: float, missed: int) -> None:
        """Count a tick in real time. duration_s: of its work; missed: ticks in all so far."""
        self.duration.record(duration_s)
        self.lateness.record(lateness_s)
        self.missed = missed

    def record_silence(self, seats: Iterable[Seat], ticks: int) -> None:
        """Count ticks of a race, and those for seats without a fresh control. seats: taken ones."""
        self.ticks += ticks
        for seat in seats:
            if seat.silence:
                self.silent[seat.number] += ticks

    def record_control(self, seat: int, before: int, sequence: int) -> None:
        """Count a control that was received. before: sequence of the one received before it."""
        self.controls[seat] += 1
        if 0 < before < sequence:
            self.lost[seat] += sequence - before - 1

    def stillness(self, still_s: float) -> str:
        """Return in a sentence what is wrong with the loop, nothing while it turns.

        still_s: a loop that has not turned for this long is not healthy.
        """
        still = time.monotonic() - self.turned_at
        return f"the loop has not turned for {still:.1f} s" if still > still_s else ""
