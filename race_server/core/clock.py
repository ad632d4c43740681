"""Time: tick numbers inside, microseconds for laps, and the pacing of a live race.

A tick is the step of the rules and of the live server, 1/60 s. Motion and contacts run in
`SUBSTEPS` steps inside each tick, so physics runs at 120 Hz.
"""

import time
from dataclasses import dataclass, field

TICKS_PER_SECOND = 60
SUBSTEPS = 2
TICK_S = 1.0 / TICKS_PER_SECOND
SUBSTEP_S = TICK_S / SUBSTEPS
MICROSECONDS = 1_000_000

# Below this the operating system's sleep is too coarse; the rest of the wait is spent spinning. A
# sleep of Linux is 0.1 ms longer than asked for; half a millisecond took 3 % of a core.
SPIN_S = 0.0002


def ticks_of(seconds: float) -> int:
    """Return the whole number of ticks nearest to `seconds`."""
    return round(seconds * TICKS_PER_SECOND)


def seconds_of(microseconds: int) -> float:
    """Return `microseconds` in seconds."""
    return microseconds / MICROSECONDS


def lap_text(microseconds: int | None) -> str:
    """Return a lap time as people write it, such as ``1:03.742``; a dash where there is none."""
    if microseconds is None or microseconds <= 0:
        return "–"
    thousandths = (microseconds + 500) // 1000
    minutes, rest = divmod(thousandths, 60_000)
    seconds, thousandths = divmod(rest, 1000)
    return (
        f"{minutes}:{seconds:02d}.{thousandths:03d}" if minutes else f"{seconds}.{thousandths:03d}"
    )


@dataclass
class Pacer:
    """Keep a loop at one turn per `period_s`, on absolute deadlines.

    A turn that comes too late is counted in `missed` and dropped, so that a slow moment never
    makes the loop race to catch up.
    """

    period_s: float = TICK_S
    missed: int = 0
    lateness_s: float = 0.0
    _deadline: float = field(default=0.0, repr=False)

    def start(self) -> None:
        """Put the first deadline one period from now."""
        self._deadline = time.perf_counter() + self.period_s

    def wait(self) -> None:
        """Return at the next deadline; `lateness_s` says by how much it was missed."""
        remaining = self._deadline - time.perf_counter()
        if remaining > SPIN_S:
            time.sleep(remaining - SPIN_S)
        while time.perf_counter() < self._deadline:
            pass
        self.lateness_s = time.perf_counter() - self._deadline
        self._deadline += self.period_s
        if self.lateness_s > self.period_s:
            skipped = int(self.lateness_s / self.period_s)
            self.missed += skipped
            self._deadline += skipped * self.period_s
