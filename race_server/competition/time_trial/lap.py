"""Laps of a trial: cut out of the samples taken at each decision, with their figures."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from race_server.competition.time_trial.gaps import DECISION_S
from race_server.core.clock import MICROSECONDS
from race_server.core.state import Floats, Record

# Rows of a lap's trace. Time since the lap began, progress along the centre line; pedals are those
# that act from each sample on, and not in traces from before they were kept.
COLUMNS = ("time_s", "progress", "x", "y", "speed", "steering", "throttle", "brake")
TIME, PROGRESS, X, Y, SPEED, STEERING, THROTTLE, BRAKE = range(8)
PEDALS = COLUMNS[THROTTLE:]


@dataclass(frozen=True, eq=False)
class TrialLap:
    """One lap that counts."""

    number: int  # from 1
    time_us: int
    sectors_us: tuple[int, ...]
    is_flying: bool  # False: from standstill
    is_clean: bool
    contacts: int  # with walls
    rescues: int
    off_track_s: float
    steering_rate: float  # [rad/s] root mean square, at the road wheels
    jerk: float  # [m/s³] root mean square, along the kart
    trace: Floats  # (C, N) rows as in COLUMNS, from line to line

    @property
    def time_s(self) -> float:
        """Time of the lap [s]."""
        return self.time_us / MICROSECONDS

    @property
    def columns(self) -> dict[str, Floats]:
        """The trace by the names of its rows, (N,) each."""
        return dict(zip(COLUMNS, self.trace, strict=True))


@dataclass(frozen=True)
class Mark:
    """A lap's end as the world reported it, and what happened since the one before."""

    end_us: int  # since the lights
    time_us: int
    sectors_us: tuple[int, ...]
    is_clean: bool
    contacts: int
    rescues: int


def note_of(seconds: float, body: Record, racer: Record) -> tuple[float, ...]:
    """Return a kart at a moment: the numbers of COLUMNS, and whether it is off the track.

    seconds: since the instant from which the marks count.
    """
    return (
        *(seconds, racer.progress, body.x, body.y, body.speed, body.steering),
        *(body.throttle, body.brake, racer.off_track),
    )


def laps_of(
    notes: Sequence[tuple[float, ...]], marks: Sequence[Mark], length: float, *, flying: bool
) -> tuple[TrialLap, ...]:
    """Return the laps that count.

    notes: one row per decision, see `note_of`; length: of the course [m]; flying: the first mark
    ends the lap that does not count.
    """
    if not marks:
        return ()
    table = np.array(notes, np.float64).T
    # The pedals of a note are those that acted until then.
    table[[THROTTLE, BRAKE], :-1] = table[[THROTTLE, BRAKE], 1:]
    counted = marks[1:] if flying else marks
    return tuple(
        _lap_of(table, mark, number, length, is_flying=flying or number > 1)
        for number, mark in enumerate(counted, start=1)
    )


def _lap_of(table: Floats, mark: Mark, number: int, length: float, *, is_flying: bool) -> TrialLap:
    end = mark.end_us / MICROSECONDS
    begin = end - mark.time_us / MICROSECONDS
    inside = (table[TIME] > begin) & (table[TIME] < end)
    trace = _from_line_to_line(table[: len(COLUMNS)], inside, begin, end, length)
    return TrialLap(
        number=number,
        time_us=mark.time_us,
        sectors_us=mark.sectors_us,
        is_flying=is_flying,
        is_clean=mark.is_clean,
        contacts=mark.contacts,
        rescues=mark.rescues,
        off_track_s=float(table[len(COLUMNS)][inside].sum()) * DECISION_S,
        steering_rate=_root_mean_square(np.diff(table[STEERING][inside]) / DECISION_S),
        jerk=_root_mean_square(np.diff(table[SPEED][inside], 2) / DECISION_S**2),
        trace=trace,
    )


def _from_line_to_line(
    table: Floats, inside: np.ndarray, begin: float, end: float, length: float
) -> Floats:
    """Return a lap's columns with a point on the timing line at both ends, interpolated."""
    edges = np.array([np.interp((begin, end), table[TIME], row) for row in table])
    edges[PROGRESS] = (0.0, length)
    middle = table[:, inside].copy()
    middle[PROGRESS] = _counted_on(middle[PROGRESS], length)
    trace = np.column_stack([edges[:, :1], middle, edges[:, 1:]])
    trace[TIME] -= begin
    return trace


def _counted_on(progress: Floats, length: float) -> Floats:
    """Return progress without its jump at the line, from 0 to `length`.

    A lap may begin a little behind the line: from a standing start, or pushed back by a wall.
    """
    steps = np.diff(progress, prepend=0.0)
    steps -= length * np.round(steps / length)
    return np.clip(np.cumsum(steps), 0.0, length)


def _root_mean_square(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if len(values) else 0.0


def time_at(trace: Floats, progress: Floats) -> Floats:
    """Return when [s] a lap first reached each progress [m]."""
    return column_at(trace, TIME, progress)


def column_at(trace: Floats, column: int, progress: Floats) -> Floats:
    """Return a column of a lap where it first reached each progress [m]."""
    reached = np.maximum.accumulate(trace[PROGRESS])
    first = np.concatenate([[True], np.diff(reached) > 0.0])
    return np.asarray(np.interp(progress, reached[first], trace[column][first]))
