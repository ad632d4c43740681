"""How large a course may be. What is larger is refused before anything is made of it."""

import math
from typing import Any

import numpy as np

from race_server.core.lots import ROLES
from race_server.errors import TrackError
from race_server.scenario.track.course import Course
from race_server.scenario.track.lot import Lot

# Of the centre line: 8 km for karts, 819 m for cars of 1/10. Such a course is built in a minute.
MOST_SAMPLES = 1 << 14
LEAST_POINTS, MOST_POINTS = 4, 4096  # that a line is drawn through
MOST_PIECES = 256  # of a border that is laid from blocks
MOST_OBSTACLES = MOST_STARTS = 256
MOST_ITEMS = 1024
MOST_PLACES = 64
MOST_GATES = 200
MOST_SLOTS, MOST_ZONES, MOST_BLOCKS, MOST_PEOPLE = 1024, 32, 64, 32
MOST_SLOT_ROWS = 64
MOST_HALF_WIDTH = 100.0  # [m] of the asphalt beside a line
# Two borders beside a line, and four sides of each obstacle.
MOST_WALLS = 2 * MOST_SAMPLES + 4 * MOST_OBSTACLES

# Columns of each array, and the most rows.
_SHAPES = {
    "line": (4, MOST_SAMPLES),
    "half_widths": (2, MOST_SAMPLES),
    "borders": (4, MOST_WALLS),
    "grid": (3, MOST_PLACES),
    "spots": (2, MOST_ITEMS),
    "starts": (6, MOST_STARTS),
}


def check_length(length: float, spacing: float, name: str) -> None:
    """Check that a line is not too long.

    length: of the line [m]; spacing: of its samples [m].

    Raises:
        TrackError: it is.
    """
    if not length <= MOST_SAMPLES * spacing:
        raise TrackError(
            f"{name}: a course of {length / 1e3:.3g} km; at this scale it may be "
            f"{MOST_SAMPLES * spacing / 1e3:.3g} km long"
        )


def check_count(what: str, count: int, most: int) -> None:
    """Check a number of things.

    Raises:
        TrackError: there are too many.
    """
    if count > most:
        raise TrackError(f"{count} {what}; at most {most} are allowed")


def check_sizes(course: Course) -> None:
    """Check a course that was not built from a file here: sizes, shapes, and finite numbers.

    Raises:
        TrackError: something does not fit.
    """
    for name, (columns, most) in _SHAPES.items():
        rows = getattr(course, name)
        if not isinstance(rows, np.ndarray) or rows.shape != (len(rows), columns):
            raise TrackError(f"{name} of the course is no table of {columns} columns")
        check_count(f"rows of {name}", len(rows), most)
        _check_finite(name, rows)
    if course.lot is not None:
        _check_lot(course.lot)
    is_raced = course.lot is None or len(course.line) > 0
    if len(course.line) != len(course.half_widths) or len(course.line) < 3 * is_raced:
        raise TrackError("line and half-widths of the course do not fit")
    gates, least = course.gates, 1 if is_raced else 0
    if gates.shape != (len(gates),) or not least <= len(gates) <= MOST_GATES:
        raise TrackError(f"{gates.shape} gates; 1 to {MOST_GATES} are allowed")
    _check_finite("gates", course.gates)
    check_count("obstacles", len(course.obstacles), MOST_OBSTACLES)
    if not all(0 <= gate < len(course.gates) for gate in course.sectors):
        raise TrackError("a sector of the course ends at no gate")
    for name in ("spacing", "width_mean"):
        value = getattr(course, name)
        if not (math.isfinite(value) and value > 0.0):
            raise TrackError(f"{name} of the course is {value}")


def _check_lot(lot: Lot) -> None:
    """Check the sizes of a car park, and that its numbers are finite."""
    if not isinstance(lot.slots, np.ndarray) or lot.slots.shape != (len(lot.slots), 5):
        raise TrackError("slots of the lot are no table of 5 columns")
    _check_finite("slots", lot.slots)
    check_count("slots", len(lot.slots), MOST_SLOTS)
    check_count("zones", len(lot.zones), MOST_ZONES)
    check_count("blocks", lot.blocks.count[1], MOST_BLOCKS)
    check_count("people", lot.people.count, MOST_PEOPLE)
    places = [(*zone.x, *zone.y, zone.heading, zone.spread, zone.hitch) for zone in lot.zones]
    sizes = (lot.slot_size, lot.distance, lot.blocks.side, lot.people.speed)
    shares = (lot.taken.share, lot.taken.length, lot.taken.width, lot.people.radius)
    if not np.isfinite([*np.ravel(places), *np.ravel(sizes), *shares]).all():
        raise TrackError("the lot holds other than finite numbers")
    if {zone.role for zone in lot.zones} - set(ROLES) or min(lot.blocks.count) < 0:
        raise TrackError("the lot has zones or blocks that there cannot be")


def _check_finite(name: str, numbers: Any) -> None:
    if numbers.dtype != np.float64 or not np.isfinite(numbers).all():
        raise TrackError(f"{name} of the course holds other than finite numbers")
