"""What is seen of one kart in a race, cut into laps with what happened in each."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from race_server.coaching.circumstances import TRAFFIC_S, Circumstances
from race_server.competition.time_trial.lap import TIME, Mark, TrialLap, laps_of
from race_server.core.clock import MICROSECONDS
from race_server.core.messages import Cleanness, Event, EventKind
from race_server.core.state import Floats

# What was noted this long [s] before the end of a lap is kept for the next one.
KEPT_S = 1.0


class Around(NamedTuple):
    """What besides driving decides how fast a kart is, since the note before."""

    acts: bool  # an effect of an item acts on it
    is_cautioned: bool
    gap_s: float  # to the kart ahead [s]


@dataclass(eq=False)
class LapWitness:
    """One kart of a race, as it is noted again and again."""

    number: int  # seat
    notes: list[tuple[float, ...]] = field(default_factory=list)  # as of `note_of`
    marks: list[Mark] = field(default_factory=list)
    circumstances: list[Circumstances] = field(default_factory=list)  # one for each mark
    _around: list[Around] = field(default_factory=list)  # one for each note

    def __post_init__(self) -> None:
        """Wait for the first lap."""
        self._begin()

    def _begin(self) -> None:
        self._now = Circumstances(is_flying=bool(self.marks), is_clean=True)
        self._walls = self._rescues = 0

    def note(self, row: tuple[float, ...], around: Around) -> None:
        """Keep where the kart is, later than before."""
        self.notes.append(row)
        self._around.append(around)

    def take(self, event: Event, end_us: int) -> None:
        """Take what happened to the kart. end_us: when its last lap ended, of a lap."""
        now = self._now
        if event.kind is EventKind.HIT:
            self._now = replace(now, hits=now.hits + 1)
        elif event.kind is EventKind.CONTACT_KART:
            self._now = replace(now, contacts=now.contacts + 1)
        elif event.kind is EventKind.CONTACT_WALL:
            self._walls += 1
        elif event.kind is EventKind.RESCUED:
            self._rescues += 1
        elif event.kind is EventKind.LAP:
            is_clean = event.detail == Cleanness.CLEAN
            mark = Mark(end_us, event.value, (), is_clean, self._walls, self._rescues)
            self.circumstances.append(self._with_times(replace(now, is_clean=is_clean), mark))
            self.marks.append(mark)
            self._begin()

    def _with_times(self, now: Circumstances, mark: Mark) -> Circumstances:
        """Return what happened in a lap with the times of what lasted; its end may be told late."""
        end_s = mark.end_us / MICROSECONDS
        begin_s, effect_s, caution_s, traffic_s = end_s - mark.time_us / MICROSECONDS, 0.0, 0.0, 0.0
        times = [note[TIME] for note in self.notes]
        for (before_s, now_s), around in zip(pairwise(times), self._around[1:], strict=True):
            if begin_s < now_s <= end_s:
                effect_s += (now_s - before_s) * around.acts
                caution_s += (now_s - before_s) * around.is_cautioned
                traffic_s += (now_s - before_s) * (around.gap_s < TRAFFIC_S)
        return replace(now, effect_s=effect_s, caution_s=caution_s, traffic_s=traffic_s)

    def laps(self, length: float) -> list[tuple[TrialLap, Circumstances]]:
        """Return all laps so far. length: of the course [m]."""
        laps = laps_of(self.notes, self.marks, length, flying=False)
        return list(zip(laps, self.circumstances, strict=True))

    def newest(self, length: float) -> tuple[TrialLap, Circumstances]:
        """Return the lap that ended last."""
        (lap,) = laps_of(self.notes, self.marks[-1:], length, flying=False)
        now = self.circumstances[-1]
        return replace(lap, number=len(self.marks), is_flying=now.is_flying), now

    def forget(self, before_s: float) -> None:
        """Forget what was noted before a time [s], but for a moment."""
        first = sum(note[TIME] <= before_s - KEPT_S for note in self.notes)
        del self.notes[:first], self._around[:first]


def touched(event: Event) -> Sequence[int]:
    """Return the seats of the karts that something happened to."""
    other = event.other if event.kind is EventKind.CONTACT_KART else -1
    return [number for number in (event.kart, other) if number >= 0]


def gaps_ahead(progress: Floats, speed: Floats, racing: np.ndarray, length: float) -> Floats:
    """Return how long (K,) [s] each kart takes to where the next one ahead is; inf without one.

    progress: (K,) [m] along the course of `length` [m]; speed: (K,) [m/s]; racing: (K,) karts that
    are on the course.
    """
    if not len(progress):
        return np.zeros(0)
    nearest = _ways_ahead(progress, racing, length).min(axis=1)
    return np.asarray(np.where(racing, nearest / np.maximum(speed, 0.1), np.inf))


def gaps_behind(progress: Floats, speed: Floats, racing: np.ndarray, length: float) -> Floats:
    """Return how long (K,) [s] the next kart takes to where each one is, see `gaps_ahead`."""
    if not len(progress):
        return np.zeros(0)
    times = _ways_ahead(progress, racing, length) / np.maximum(speed, 0.1)[:, None]
    times[~racing] = np.inf
    return np.asarray(np.where(racing, times.min(axis=0), np.inf))


def _ways_ahead(progress: Floats, racing: np.ndarray, length: float) -> Floats:
    """Return how far (K, K) [m] it is from each kart on to each other one that races."""
    ahead = (progress[None, :] - progress[:, None]) % length
    ahead[:, ~racing] = np.inf
    np.fill_diagonal(ahead, np.inf)
    return np.asarray(ahead)
