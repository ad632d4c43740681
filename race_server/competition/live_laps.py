"""The laps of a race that is on, from what spectators receive: snapshots and events."""

import math
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from race_server.competition.lap_witness import (
    Around,
    LapWitness,
    gaps_ahead,
    gaps_behind,
    touched,
)
from race_server.competition.time_trial.gaps import DECISION_TICKS
from race_server.competition.time_trial.lap import PROGRESS, TIME, TrialLap
from race_server.core.clock import MICROSECONDS, TICK_S
from race_server.core.messages import Event, EventKind, Flag, KartFlag, Status
from race_server.net.wire.spectate import SnapshotFrame

# A lap in which no snapshot came for longer than this [s] is not looked at.
MOST_BLIND_S = 0.25
# Notes of one lap at most: ten minutes.
MOST_NOTES = 12_000


@dataclass(frozen=True, eq=False)
class SeenLap:
    """A lap of a race, whose pedals were not seen."""

    seat: int
    number: int  # from 1
    lap: TrialLap
    reason: str  # why it is not compared; empty where it is


@dataclass(frozen=True)
class Glance:
    """One kart at one moment."""

    seat: int
    seconds: float  # since the countdown began
    progress: float  # [m]
    speed: float  # [m/s]
    ahead_s: float  # to the kart ahead [s]; inf without one
    behind_s: float
    is_cautioned: bool
    is_driving: bool  # in the race, the right way round, with no effect of an item


class LiveLaps:
    """What was seen of all karts of one race."""

    def __init__(self, length: float) -> None:
        """Wait for a race. length: of the course [m]."""
        self._length = length
        self.begin()

    def begin(self) -> None:
        """Forget all: another race begins."""
        self._karts: dict[int, LapWitness] = {}
        self._pending: deque[Event] = deque()
        self._tick = -DECISION_TICKS

    def hear(self, events: Iterable[Event]) -> None:
        """Take events, in order; each counts once a snapshot from after its tick has come."""
        self._pending += events

    def see(self, frame: SnapshotFrame) -> list[Glance]:
        """Take a snapshot; return what it shows of each kart, or nothing so soon after the last."""
        if frame.tick < self._tick + DECISION_TICKS:
            return []
        self._tick = frame.tick
        glances = self._look(frame)
        for glance, row in zip(glances, frame.karts, strict=True):
            if row["status"] != Status.RACING:
                continue
            witness = self._karts.setdefault(glance.seat, LapWitness(glance.seat))
            place = (glance.seconds, glance.progress, float(row["x"]), float(row["y"]))
            witness.note(
                (*place, glance.speed, float(row["steering"]), 0.0, 0.0, _is_off(row)),
                Around(bool(row["effects"]), glance.is_cautioned, glance.ahead_s),
            )
            if len(witness.notes) > MOST_NOTES:  # it stands somewhere: that lap is not looked at
                witness.forget(glance.seconds)
        return glances

    def _look(self, frame: SnapshotFrame) -> list[Glance]:
        karts, seconds = frame.karts, frame.tick * TICK_S
        racing = karts["status"] == Status.RACING
        along, speed = (karts[name].astype(np.float64) for name in ("progress", "speed"))
        ahead = gaps_ahead(along, speed, racing, self._length)
        behind = gaps_behind(along, speed, racing, self._length)
        drives = racing & (karts["effects"] == 0) & (karts["flags"] & KartFlag.WRONG_WAY == 0)
        is_cautioned = karts["flags"] & KartFlag.YELLOW != 0
        is_cautioned |= frame.flag in (Flag.YELLOW, Flag.RED)
        return [
            Glance(
                *(int(row["seat"]), seconds, float(along[place]), float(speed[place])),
                *(float(ahead[place]), float(behind[place])),
                bool(is_cautioned[place]),
                bool(drives[place]),
            )
            for place, row in enumerate(karts)
        ]

    def ended(self, *, is_over: bool = False) -> Iterator[SeenLap]:
        """Yield the laps that have ended since. is_over: no more snapshots come."""
        while self._pending and (is_over or self._pending[0].tick < self._tick):
            event = self._pending.popleft()
            for seat in touched(event):
                witness = self._karts.get(seat)
                if witness is None:
                    continue
                if event.kind is not EventKind.LAP:
                    witness.take(event, 0)
                    continue
                end_s = _crossed_s(witness, event.tick * TICK_S, self._length)
                witness.take(event, round(end_s * MICROSECONDS))
                if _is_whole(witness, end_s, event.value / MICROSECONDS):
                    lap, circumstances = witness.newest(self._length)
                    yield SeenLap(seat, event.other, lap, circumstances.reason)
                witness.forget(end_s)


def _is_off(row: np.void) -> float:
    return float(bool(row["flags"] & KartFlag.OFF_TRACK))


def _crossed_s(witness: LapWitness, near_s: float, length: float) -> float:
    """Return when a kart crossed the timing line [s], at some time or shortly before."""
    for after, before in pairwise(reversed(witness.notes)):
        if before[TIME] > near_s + TICK_S:  # its event came late
            continue
        if before[TIME] < near_s - 1.0:
            break
        left = length - before[PROGRESS]
        if before[PROGRESS] - after[PROGRESS] > 0.5 * length:
            share = left / max(left + after[PROGRESS], 1e-9)
            return before[TIME] + share * (after[TIME] - before[TIME])
    return near_s


def _is_whole(witness: LapWitness, end_s: float, lap_s: float) -> bool:
    """Return whether a lap was seen from line to line without a long break."""
    times = [note[TIME] for note in witness.notes if note[TIME] > end_s - lap_s - MOST_BLIND_S]
    begins = bool(times) and times[0] <= end_s - lap_s + TICK_S
    return begins and max(np.diff([*times, end_s]), default=math.inf) <= MOST_BLIND_S
