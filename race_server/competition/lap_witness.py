"""What is seen of one kart in a race, cut into laps with what happened in each."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from race_server.coaching.circumstances import TRAFFIC_S, Circumstances
from race_server.competition.time_trial.lap import TIME, Mark, TrialLap, laps_of
from race_server.core.clock import MICROSECONDS
from race_server.core.messages import Cleanness, Event, EventKind
from race_server.core.state import Floats

# What was noted this long [s] before the end of a lap is kept for the next one.
KEPT_S = 1.0


@dataclass(eq=False)
class LapWitness:
    """One kart of a race, as it is noted again and again."""

    number: int  # seat
    notes: list[tuple[float, ...]] = field(default_factory=list)  # as of `note_of`
    marks: list[Mark] = field(default_factory=list)
    circumstances: list[Circumstances] = field(default_factory=list)  # one for each mark

    def __post_init__(self) -> None:
        """Wait for the first lap."""
        self._begin()

    def _begin(self) -> None:
        self._now = Circumstances(is_flying=bool(self.marks), is_clean=True)
        self._walls = self._rescues = 0

    def note(self, row: tuple[float, ...], *, acts: bool, is_cautioned: bool, gap_s: float) -> None:
        """Keep where the kart is. Times of notes are equally far apart.

        acts: an effect of an item acts on it; gap_s: to the kart ahead [s].
        """
        spent = row[TIME] - self.notes[-1][TIME] if self.notes else 0.0
        self.notes.append(row)
        now = self._now
        self._now = replace(
            now,
            effect_s=now.effect_s + spent * acts,
            caution_s=now.caution_s + spent * is_cautioned,
            traffic_s=now.traffic_s + spent * (gap_s < TRAFFIC_S),
        )

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
            self.circumstances.append(replace(now, is_clean=is_clean))
            self.marks.append(mark)
            self._begin()

    def laps(self, length: float) -> list[tuple[TrialLap, Circumstances]]:
        """Return all laps so far. length: of the course [m]."""
        laps = laps_of(self.notes, self.marks, length, flying=False)
        return list(zip(laps, self.circumstances, strict=True))

    def newest(self, length: float) -> tuple[TrialLap, Circumstances]:
        """Return the lap that ended last, and forget what was noted before its end."""
        (lap,) = laps_of(self.notes, self.marks[-1:], length, flying=False)
        end_s = self.marks[-1].end_us / MICROSECONDS
        self.notes = [row for row in self.notes if row[TIME] > end_s - KEPT_S]
        return lap, self.circumstances[-1]


def touched(event: Event) -> Sequence[int]:
    """Return the seats of the karts that something happened to."""
    other = event.other if event.kind is EventKind.CONTACT_KART else -1
    return [number for number in (event.kart, other) if number >= 0]


def gaps_ahead(progress: Floats, speed: Floats, racing: np.ndarray, length: float) -> Floats:
    """Return how long (K,) [s] each kart takes to where the next one ahead is; inf without one.

    progress: (K,) [m] along the course of `length` [m]; speed: (K,) [m/s]; racing: (K,) karts that
    are on the course.
    """
    ahead = _ways_ahead(progress, racing, length)
    nearest = ahead.min(axis=1)
    return np.asarray(np.where(racing, nearest / np.maximum(speed, 0.1), np.inf))


def gaps_behind(progress: Floats, speed: Floats, racing: np.ndarray, length: float) -> Floats:
    """Return how long (K,) [s] the next kart takes to where each one is, see `gaps_ahead`."""
    times = _ways_ahead(progress, racing, length) / np.maximum(speed, 0.1)[:, None]
    times[~racing] = np.inf
    return np.asarray(np.where(racing, times.min(axis=0), np.inf))


def _ways_ahead(progress: Floats, racing: np.ndarray, length: float) -> Floats:
    """Return how far (K, K) [m] it is from each kart on to each other one that races."""
    ahead = (progress[None, :] - progress[:, None]) % length
    ahead[:, ~racing] = np.inf
    np.fill_diagonal(ahead, np.inf)
    return np.asarray(ahead)
