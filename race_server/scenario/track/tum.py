"""Courses of the TUM racetrack database and of the f1tenth maps: CSV of a centre line.

Lines of ``x_m, y_m, w_tr_right_m, w_tr_left_m``. A comment, or the first line, may name the columns
in another order, and add some. Between numbers stand commas, semicolons or spaces; beside
semicolons a comma is a decimal point.
"""

import re
from pathlib import Path

import numpy as np

from race_server.errors import TrackError
from race_server.scenario.text_files import read_text
from race_server.scenario.toml_reader import FARTHEST
from race_server.scenario.track.course import Floats
from race_server.scenario.track.limits import (
    LEAST_POINTS,
    MOST_HALF_WIDTH,
    MOST_POINTS,
    check_count,
)
from race_server.scenario.track.polyline import lengths_of

# Of the largest course, with more columns than are read.
MOST_BYTES = 256 * MOST_POINTS
# Points nearer to each other than this share of the median step, or this [m], are the same: a line
# through both would turn on the spot.
SAME_SHARE, SAME = 0.05, 2e-4
# Where x, y, width right and width left stand in a row.
Columns = tuple[int, int, int, int]
USUAL: Columns = (0, 1, 2, 3)
_NAMES = ("x", "y", "width right", "width left")
# The name of a column, with its unit perhaps; that of a table's numbers may be empty.
_COLUMN = re.compile(r"(\w+\s*([\[(].*[\])])?)?")


def read_tum(path: Path) -> Floats:
    """Return points of a centre line with half-widths, shape (N, 4): x, y, left, right [m].

    A point that comes again is left out, as the first one at the end.

    Raises:
        TrackError: the file cannot be read, is too long, or holds something else.
    """
    rows: list[tuple[float, float, float, float]] = []
    columns = USUAL
    lines = read_text(path, MOST_BYTES, TrackError).splitlines()
    for number, line in enumerate(lines, start=1):
        text, _, comment = line.partition("#")
        place = f"{path}, line {number}"
        least = 2 if text.strip() else len(USUAL)  # words of a comment may be no columns
        if not rows and (named := _columns_in(text.strip() or comment, place, least)):
            columns = named
        elif text.strip():
            rows.append(_row(text.strip(), columns, place))
    check_count(f"points in {path}", len(rows), MOST_POINTS)
    points = _apart(np.array(rows).reshape(-1, 4))
    if len(points) < LEAST_POINTS:
        raise TrackError(
            f"{path}: {len(points)} points that are apart make no course; give {LEAST_POINTS} or "
            "more"
        )
    return points


def _words_in(text: str) -> list[str]:
    """Return what stands between the separators of a line."""
    separator = next((one for one in ";," if one in text), None)
    words = [word.strip().strip('"') for word in text.split(separator)]
    while words and not words[-1]:  # a row may end with a separator
        words.pop()
    return words


def _columns_in(text: str, place: str, least: int) -> Columns | None:
    """Return where a line of names says that the four numbers stand, None if it names none.

    least: names that it has.

    Raises:
        TrackError: it names places without widths.
    """
    names = _words_in(text)
    if len(names) < least or not all(map(_COLUMN.fullmatch, names)):
        return None
    words = [re.findall("[a-z]+", name.lower()) for name in names]
    x, y = (next((n for n, one in enumerate(words) if one[:1] == [axis]), -1) for axis in "xy")
    right, left = (
        next((n for n, one in enumerate(words) if side in one), -1) for side in ("right", "left")
    )
    if min(x, y) < 0:
        return None
    if min(right, left) >= 0:
        return x, y, right, left
    if (x, y) == USUAL[:2] and len(names) >= len(USUAL):
        return USUAL
    raise TrackError(
        f"{place}: columns {', '.join(names)[:60]}: none for the widths to the right and left; "
        "give the file of the centre line"
    )


def _row(text: str, columns: Columns, place: str) -> tuple[float, float, float, float]:
    """Return x, y, half-width left, half-width right [m] of a line.

    Raises:
        TrackError: it holds something else.
    """
    words = _words_in(text)
    if ";" in text:
        words = [word.replace(",", ".") for word in words]
    x, y, right, left = (
        _number(words[column] if column < len(words) else "", f"{place}: {name}")
        for name, column in zip(_NAMES, columns, strict=True)
    )
    if max(abs(x), abs(y)) > FARTHEST:
        raise TrackError(
            f"{place}: x, y = {x:g}, {y:g}: up to {FARTHEST:g} m from zero; move the course there"
        )
    if not 0.0 < min(left, right) <= max(left, right) <= MOST_HALF_WIDTH:
        raise TrackError(
            f"{place}: widths right, left = {right:g}, {left:g}: from the line to each side they "
            f"are above 0 and up to {MOST_HALF_WIDTH:g} m; the columns are x, y, width right, "
            "width left, unless the first line names them"
        )
    return x, y, left, right


def _number(word: str, what: str) -> float:
    """Return the finite number that a word is.

    Raises:
        TrackError: it is none; it begins with `what`.
    """
    try:
        value = float(word)
    except ValueError:
        value = np.nan
    if not np.isfinite(value):
        found = repr(word[:40]) if word else "empty"
        raise TrackError(f"{what} is {found}; give a finite number in metres")
    return value


def _apart(points: Floats) -> Floats:
    """Return points (N, 4) without those that are the same as the one before them."""
    if not len(points):
        return points
    least = max(SAME_SHARE * float(np.median(lengths_of(points[:, :2]))), SAME)
    kept = [0]
    for number in range(1, len(points)):
        if np.hypot(*(points[number] - points[kept[-1]])[:2]) > least:
            kept.append(number)
    if len(kept) > 1 and np.hypot(*(points[kept[-1]] - points[0])[:2]) <= least:
        kept.pop()
    return points[kept]
