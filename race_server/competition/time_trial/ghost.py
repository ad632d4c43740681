"""Ghosts: recorded laps to compare with, and where another lap gains and loses time on them."""

import csv
import io
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from race_server.competition.time_trial.lap import (
    COLUMNS,
    PEDALS,
    PROGRESS,
    SPEED,
    TIME,
    X,
    Y,
    time_at,
)
from race_server.core.clock import MICROSECONDS, lap_text
from race_server.core.state import Floats
from race_server.errors import ResultsError
from race_server.scenario.track.course import Course
from race_server.storage.results.queries import Row, laps_on, trace_of
from race_server.storage.results.schema import damaged
from race_server.storage.whole_file import write_whole

BEST = "best"
# Laps listed in an error message, at most.
_NAMED = 8
# Greatest distance from the line at the ends of a lap from a file, as a share of the course.
_OFF_LINE_SHARE = 0.02


@dataclass(frozen=True, eq=False)
class Ghost:
    """A lap to compare with."""

    name: str  # for a person
    time_s: float
    trace: Floats  # (C, N)


def ghost_of(words: str, course: Course, vehicle: str, results: Path | None) -> Ghost:
    """Return the ghost called `words` on a course.

    words: `best`, the fastest clean lap of this vehicle in the results file; RACE/LAP or
    RACE/SEAT/LAP, as `race results list` numbers races; or a .csv file as `--save-lap` writes it.
    Of a lap from a live race only the sectors are known: its speed is constant in each.

    Raises:
        ResultsError: there is no such lap; the message lists those that exist.
    """
    if words.endswith(".csv"):
        return _read(Path(words), course)
    if results is None:
        raise ResultsError(f"ghost {words!r}: no results file; name one with --results, or a .csv")
    rows = laps_on(results, track=course.name, digest=course.digest)
    for row in rows:
        if _is_wanted(words, row, vehicle):
            return _from_file(results, row, course)
    known = ", ".join(_name_of(row) for row in rows[:_NAMED]) or "none: run a trial first"
    more = f" and {len(rows) - _NAMED} more" if len(rows) > _NAMED else ""
    raise ResultsError(
        f"no ghost {words!r} on {course.name} for {vehicle} in {results}; laps there: {known}{more}"
    )


def _is_wanted(words: str, row: Row, vehicle: str) -> bool:
    if words == BEST:
        return row["vehicle"] == vehicle and row["is_clean"]
    names = {f"{row['race']}/{row['seat']}/{row['number']}"}
    if row["seat"] == 0:
        names.add(f"{row['race']}/{row['number']}")
    return words in names


def _name_of(row: Row) -> str:
    """Return a lap as `--ghost` takes it, with its driver, vehicle and time."""
    seat = f"{row['seat']}/" if row["seat"] else ""
    lap = f"{row['race']}/{seat}{row['number']}"
    return f"{lap} ({row['driver']}, {row['vehicle']}, {lap_text(row['time_us'])})"


def _from_file(results: Path, row: Row, course: Course) -> Ghost:
    name, time_s = _name_of(row), row["time_us"] / MICROSECONDS
    if not row["has_trace"]:
        return Ghost(f"{name}, by its sectors", time_s, _evenly(row, course))
    columns = trace_of(results, row["race"], row["seat"], row["number"])
    known = [columns.get(column) for column in COLUMNS if column not in PEDALS]
    if any(column is None for column in known) or not _goes_on(np.array(known)):
        raise damaged(results, f"the trace of lap {name} is none")
    # Traces from before pedals were kept have none: they count as released.
    nothing = np.zeros_like(known[0])
    return Ghost(name, time_s, np.array([columns.get(column, nothing) for column in COLUMNS]))


def _goes_on(table: Floats) -> bool:
    """Return whether a table (C, N) may be a trace: finite numbers, and time goes up."""
    is_finite = table.shape[1] > 1 and bool(np.isfinite(table).all())
    return is_finite and bool((np.diff(table[TIME]) > 0.0).all())


def _evenly(row: Row, course: Course) -> Floats:
    """Return a trace along the centre line with the times of the sectors, shape (C, N)."""
    ends, sectors = _sector_ends(course), _sectors(row)
    if len(sectors) != len(ends):
        ends, sectors = (course.length,), [row["time_us"]]
    progress = np.append(np.arange(len(course.line)) * course.spacing, course.length)
    times = np.cumsum([0, *sectors]) / MICROSECONDS
    trace = np.zeros((len(COLUMNS), len(progress)))
    trace[TIME] = np.interp(progress, (0.0, *ends), times)
    trace[PROGRESS] = progress
    trace[[X, Y]] = np.vstack([course.line[:, :2], course.line[:1, :2]]).T
    trace[SPEED] = np.gradient(progress, trace[TIME])
    return trace


def _sectors(row: Row) -> list[int]:
    """Return the times of the sectors of a lap [µs], none where they are damaged."""
    try:
        times = [int(time_us) for time_us in json.loads(row["sectors"])]
    except (ValueError, TypeError, OverflowError, RecursionError):
        return []
    return times if all(0 < time_us <= row["time_us"] for time_us in times) else []


def _read(path: Path, course: Course) -> Ghost:
    try:
        with path.open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        # Files from before pedals were kept have none: they count as released.
        table = np.array(
            [
                [float(row.get(name, 0.0) if name in PEDALS else row[name]) for row in rows]
                for name in COLUMNS
            ]
        )
    except OSError as error:
        raise ResultsError(f"{path}: cannot be read: {error.strerror}") from error
    except (KeyError, ValueError, TypeError, csv.Error) as error:
        raise ResultsError(
            f"{path}: no lap ({error}); a lap has the columns {', '.join(COLUMNS)}, as "
            "`race trial --save-lap` writes them"
        ) from error
    off = _OFF_LINE_SHARE * course.length
    if (
        not _goes_on(table)
        or abs(table[PROGRESS, 0]) > off
        or abs(table[PROGRESS, -1] - course.length) > off
    ):
        raise ResultsError(
            f"{path}: no lap of {course.name}: progress runs from 0 to {course.length:.1f} m, "
            "time goes up, and all numbers are finite"
        )
    return Ghost(path.name, float(table[TIME, -1] - table[TIME, 0]), table)


def save_lap(trace: Floats, path: Path) -> None:
    """Write the trace of a lap, shape (C, N), as a .csv file.

    Raises:
        ResultsError: the file cannot be written.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(COLUMNS)
    writer.writerows([f"{value:.6f}" for value in point] for point in trace.T)
    try:
        write_whole(path, text.getvalue())
    except OSError as error:
        raise ResultsError(f"{path}: cannot be written: {error.strerror}") from error


def delta(trace: Floats, reference: Floats, progress: Floats) -> Floats:
    """Return how far [s] a lap is behind another at each progress [m]; negative if ahead."""
    return time_at(trace, progress) - time_at(reference, progress)


def sector_deltas(trace: Floats, reference: Floats, course: Course) -> tuple[float, ...]:
    """Return what a lap loses [s] on another in each sector."""
    behind = delta(trace, reference, np.array(_sector_ends(course)))
    # Rounded to microseconds, so that zero is never minus zero.
    return tuple(round(float(lost), 6) + 0.0 for lost in np.diff(behind, prepend=0.0))


def _sector_ends(course: Course) -> tuple[float, ...]:
    """Return the progress [m] at which each sector ends, the timing line last."""
    return (*(float(course.gates[gate]) for gate in sorted(course.sectors) if gate), course.length)
