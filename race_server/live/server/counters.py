"""How a server is doing, in plain numbers: the loop writes them, whoever asks reads them."""

import time
from bisect import bisect_left
from dataclasses import dataclass, field

from race_server.core.clock import TICK_S

# Upper ends of the bins [s]; a tick lasts 16.7 ms.
DURATIONS = (0.0005, 0.001, 0.002, 0.003, 0.004, 0.006, 0.008, 0.012, TICK_S, 0.033, 0.1)
LATENESSES = (0.00002, 0.00005, 0.0001, 0.0002, 0.0005, 0.001, 0.002, 0.004, 0.008, TICK_S, 0.1)
# A loop that has not turned for so long is no longer healthy.
STILL_S = 1.0


@dataclass
class Histogram:
    """How often a time fell into which bin; the last bin has no end."""

    ends: tuple[float, ...]  # [s]
    counts: list[int] = field(init=False)
    total: float = 0.0  # [s]

    def __post_init__(self) -> None:
        """Begin with empty bins."""
        self.counts = [0] * (len(self.ends) + 1)

    def note(self, seconds: float) -> None:
        """Count a time."""
        self.counts[bisect_left(self.ends, seconds)] += 1
        self.total += seconds


@dataclass
class Counters:
    """All that the loop counts. It never waits here: readers may see one number before another."""

    seats: int
    duration: Histogram = field(default_factory=lambda: Histogram(DURATIONS))
    lateness: Histogram = field(default_factory=lambda: Histogram(LATENESSES))
    ticks: int = 0
    missed: int = 0
    controls: list[int] = field(init=False)  # of each seat, taken
    lost: list[int] = field(init=False)  # of each seat, sent but never taken
    silent: list[int] = field(init=False)  # of each seat, ticks without a fresh control
    turned_at: float = field(default_factory=time.monotonic)  # when the loop last came around

    def __post_init__(self) -> None:
        """Begin with zero for each seat."""
        self.controls, self.lost, self.silent = ([0] * self.seats for _ in range(3))

    def note_tick(self, duration_s: float, lateness_s: float, missed: int) -> None:
        """Count a tick in real time. duration_s: of its work; missed: ticks in all so far."""
        self.duration.note(duration_s)
        self.lateness.note(lateness_s)
        self.missed = missed

    def note_control(self, seat: int, before: int, sequence: int) -> None:
        """Count a control that was taken. before: sequence of the one taken before it."""
        self.controls[seat] += 1
        if 0 < before < sequence:
            self.lost[seat] += sequence - before - 1

    def stillness(self) -> str:
        """Return in a sentence what is wrong with the loop, nothing while it turns."""
        still = time.monotonic() - self.turned_at
        return f"the loop has not turned for {still:.1f} s" if still > STILL_S else ""
