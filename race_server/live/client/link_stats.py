"""What a driver's client receives of a race, and how old it is on arrival."""

import statistics
import time
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass, field

from race_server.core.clock import TICK_S, TICKS_PER_SECOND
from race_server.core.messages import Event, EventKind, Retirement
from race_server.live.client.clock_offset import ClockOffset
from race_server.live.client.event_stream import EventStream

# The newest ages are kept for the median, at most this many.
MAX_AGES = 4096
# Events that are remembered, so that repeated ones count once.
MAX_EVENTS = 1024
# A world that is slower or faster than real time by more than this share has no ages: it waits.
PACE_TOLERANCE = 0.1

_RETIREMENTS = {
    Retirement.CRASH: "crashed",
    Retirement.WITHDREW: "withdrawn, by itself or sent away, or away or silent for too long",
    Retirement.WRONG_WAY: "drove the wrong way",
    Retirement.STOPPED: "stood for too long",
    Retirement.TIME_OUT: "the time was over",
    Retirement.RAMMING: "drove into others",
    Retirement.LOST: "its position was lost for too long",
    Retirement.LEFT_LOT: "too far from its slot",
    Retirement.HIT_PERSON: "hit a person",
    Retirement.JACK_KNIFE: "bent a hitch too far",
    Retirement.OWN_BODY: "touched itself with a trailer",
    Retirement.REMOVED: "taken out by the stewards",
}


@dataclass
class LinkStats:
    """What one driver has received."""

    received: int = 0  # observations
    missing: int = 0  # observations that were sent and never received
    longest_gap_s: float = 0.0
    worst_age_s: float = 0.0  # of what the driver acted on, right before the next came
    last_age_s: float = 0.0  # the same, of the newest two
    last_gap_s: float = 0.0  # between the newest two
    reconnects: int = 0
    laps: int = 0  # as they were published
    outcome: str = ""  # how the race ended for this driver, and why
    receives_events: bool = False
    offset: ClockOffset = field(default_factory=ClockOffset)
    ages_s: deque[float] = field(default_factory=lambda: deque(maxlen=MAX_AGES))
    _first: tuple[int, float] = (-1, 0.0)  # tick and time of the first of this epoch
    _last: tuple[int, float] = (-1, 0.0)
    _events: EventStream = field(default_factory=lambda: EventStream(MAX_EVENTS))

    def begin(self) -> None:
        """Begin another race."""
        self.offset.restart()
        self._first = self._last = (-1, 0.0)

    def record_observation(self, tick: int, now_s: float, decision_ticks: int) -> None:
        """Record an observation. decision_ticks: from one to the next."""
        before, received_at = self._last
        self.received += 1
        self.offset.record(tick * TICK_S, now_s)
        if before >= 0:
            self.missing += max((tick - before) // decision_ticks - 1, 0)
            self.last_gap_s = now_s - received_at
            self.last_age_s = self.offset.age_s(before * TICK_S, now_s)
            self.longest_gap_s = max(self.longest_gap_s, self.last_gap_s)
            self.worst_age_s = max(self.worst_age_s, self.last_age_s)
        else:
            self._first = (tick, now_s)
        self.ages_s.append(self.offset.age_s(tick * TICK_S, now_s))
        self._last = (tick, now_s)

    def record_events(self, epoch: int, events: Iterable[Event], seat: int) -> None:
        """Record events, each once: after a reconnection the recent ones arrive again."""
        for event in self._events.receive(epoch, events):
            self.record_event(event, seat)

    def record_event(self, event: Event, seat: int) -> None:
        """Record what happened to the driver of a seat."""
        if event.kart != seat:
            return
        if event.kind is EventKind.LAP:
            self.laps += 1
        elif event.kind is EventKind.FINISH:
            self.outcome = "finished"
        elif event.kind is EventKind.PARKED:
            self.outcome = "parked"
        elif event.kind is EventKind.RETIRED:
            known = event.other in {int(reason) for reason in Retirement}
            reason = Retirement(event.other) if known else Retirement.WITHDREW
            self.outcome = f"out: {_RETIREMENTS[reason]}"

    def wait_for_outcome(self, timeout_s: float) -> None:
        """Wait until it is known how the race ended; it is published once it is stored."""
        deadline = time.monotonic() + timeout_s
        while self.receives_events and not self.outcome and time.monotonic() < deadline:
            time.sleep(0.02)

    def is_in_real_time(self) -> bool:
        """Return whether the world keeps pace with our clock, so that ages mean something."""
        ticks, seconds = (b - a for a, b in zip(self._first, self._last, strict=True))
        return seconds > 0.0 and abs(ticks / TICKS_PER_SECOND / seconds - 1.0) < PACE_TOLERANCE

    def as_json(self) -> dict[str, float | int | str | None]:
        """Return the figures as plain data; ages are None where the world waits for drivers."""
        real = self.is_in_real_time()
        return {
            "observations": self.received,
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
        return f"sees {age}{self.received} observations, {self.missing} missing"
