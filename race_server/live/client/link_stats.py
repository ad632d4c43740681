"""What a client hears of a race, and how old it is when it is heard."""

import statistics
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from race_server.core.clock import TICK_S, TICKS_PER_SECOND
from race_server.core.messages import Event, EventKind, Retirement

# The quickest message of so long ago counts no longer: clocks drift [s].
WINDOW_S = 30.0
# Ages of so many messages are kept for the median.
MOST_AGES = 4096
# A world that is slower or faster than real time by more than this has no ages: it waits.
PACE_TOLERANCE = 0.1


class ClockOffset:
    """How far a sender's clock is behind ours, from one-way messages alone.

    The quickest message of late was hardly delayed, so what it took counts as the offset; half of
    the shortest round trip known is added as the least that a message takes.
    """

    def __init__(self) -> None:
        """Know nothing yet."""
        self._way = float("inf")
        self.restart()

    def restart(self) -> None:
        """Forget the sender's clock, but not how far away it is: it has been set anew."""
        self._least = self._before = float("inf")  # of this window and of the one before
        self._begun = float("-inf")

    @property
    def offset_s(self) -> float:
        """Our clock minus the sender's, by the quickest message."""
        return min(self._least, self._before)

    def note(self, sent_s: float, received_s: float) -> None:
        """Take note of a message, sent by the sender's clock and received by ours."""
        if received_s - self._begun > WINDOW_S:
            self._before, self._least, self._begun = self._least, float("inf"), received_s
        self._least = min(self._least, received_s - sent_s)

    def note_round_trip(self, seconds: float) -> None:
        """Take note of how long a request and its answer took together."""
        self._way = min(self._way, 0.5 * seconds)

    def age_s(self, sent_s: float, now_s: float) -> float:
        """Return how old now, by our clock, a message of the sender is."""
        way = self._way if self._way < float("inf") else 0.0
        return max(now_s - sent_s - self.offset_s, 0.0) + way


_RETIREMENTS = {
    Retirement.CRASH: "crashed",
    Retirement.WITHDREW: "withdrawn, by itself, by the stewards, or away or silent for too long",
    Retirement.WRONG_WAY: "drove the wrong way",
    Retirement.STOPPED: "stood for too long",
    Retirement.TIME_OUT: "the time was over",
    Retirement.RAMMING: "drove into others",
}


@dataclass
class LinkStats:
    """What one driver has heard."""

    heard: int = 0
    missing: int = 0  # observations that were sent and never seen
    longest_gap_s: float = 0.0
    worst_age_s: float = 0.0  # of what the driver acted on, right before the next came
    last_age_s: float = 0.0  # the same, of the newest two
    last_gap_s: float = 0.0  # between the newest two
    reconnects: int = 0
    laps: int = 0  # as they were announced
    outcome: str = ""  # how the race ended for this driver, and why
    hears_events: bool = False
    offset: ClockOffset = field(default_factory=ClockOffset)
    ages_s: deque[float] = field(default_factory=lambda: deque(maxlen=MOST_AGES))
    _first: tuple[int, float] = (-1, 0.0)  # tick and time of the first of this epoch
    _last: tuple[int, float] = (-1, 0.0)
    _told: set[tuple[int, int]] = field(default_factory=set)  # epochs and numbers of events

    def begin(self) -> None:
        """Take note that another race begins."""
        self.offset.restart()
        self._first = self._last = (-1, 0.0)

    def note(self, tick: int, now_s: float, decision_ticks: int) -> None:
        """Take note of an observation. decision_ticks: from one to the next."""
        before, heard_at = self._last
        self.heard += 1
        self.offset.note(tick * TICK_S, now_s)
        if before >= 0:
            self.missing += max((tick - before) // decision_ticks - 1, 0)
            self.last_gap_s = now_s - heard_at
            self.last_age_s = self.offset.age_s(before * TICK_S, now_s)
            self.longest_gap_s = max(self.longest_gap_s, self.last_gap_s)
            self.worst_age_s = max(self.worst_age_s, self.last_age_s)
        else:
            self._first = (tick, now_s)
        self.ages_s.append(self.offset.age_s(tick * TICK_S, now_s))
        self._last = (tick, now_s)

    def note_events(self, epoch: int, events: Iterable[Event], seat: int) -> None:
        """Take note of events, each once: after a break the last ones are told again."""
        for event in events:
            if (epoch, event.sequence) not in self._told:
                self._told.add((epoch, event.sequence))
                self.note_event(event, seat)

    def note_event(self, event: Event, seat: int) -> None:
        """Take note of what happened to the driver of a seat."""
        if event.kart != seat:
            return
        if event.kind is EventKind.LAP:
            self.laps += 1
        elif event.kind is EventKind.FINISH:
            self.outcome = "finished"
        elif event.kind is EventKind.RETIRED:
            known = event.other in {int(reason) for reason in Retirement}
            reason = Retirement(event.other) if known else Retirement.WITHDREW
            self.outcome = f"out: {_RETIREMENTS[reason]}"

    def wait_for_outcome(self, timeout_s: float) -> None:
        """Wait until it is known how the race has ended; it is told once it is written down."""
        deadline = time.monotonic() + timeout_s
        while self.hears_events and not self.outcome and time.monotonic() < deadline:
            time.sleep(0.02)

    def is_in_real_time(self) -> bool:
        """Return whether the world keeps pace with our clock, so that ages mean something."""
        ticks, seconds = (b - a for a, b in zip(self._first, self._last, strict=True))
        return seconds > 0.0 and abs(ticks / TICKS_PER_SECOND / seconds - 1.0) < PACE_TOLERANCE

    def as_json(self) -> dict[str, float | int | str | None]:
        """Return the figures as plain data; ages are None where the world waits for drivers."""
        real = self.is_in_real_time()
        return {
            "observations": self.heard,
            "missing": self.missing,
            "longest_gap_s": round(self.longest_gap_s, 3),
            "median_age_s": round(statistics.median(self.ages_s), 3) if real else None,
            "worst_age_s": round(self.worst_age_s, 3) if real else None,
            "reconnects": self.reconnects,
            "laps": self.laps,
            "outcome": self.outcome,
        }

    def __str__(self) -> str:
        """Return one line for people."""
        age = f"{1e3 * self.ages_s[-1]:.0f} ms old, " if self.is_in_real_time() else ""
        return f"sees {age}{self.heard} observations, {self.missing} missing"
