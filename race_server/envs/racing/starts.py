"""Where karts may begin at random: a course's own table, or places along its centre line."""

import numpy as np

from race_server.core.state import Floats, Ints
from race_server.scenario.track.course import Course

# Places along a centre line without a table, and how far off it they reach, as shares.
PLACES = 48
OFF_LINE_SHARE = 0.4
SPREAD = np.radians(10.0)


def start_tables(courses: list[Course]) -> tuple[Floats, Ints]:
    """Return the tables of all courses, shape (S, B, 6), and their lengths, shape (S,)."""
    tables = [
        course.starts if len(course.starts) else _along_the_line(course) for course in courses
    ]
    counts = np.array([len(table) for table in tables], np.int64)
    padded = np.zeros((len(tables), int(counts.max()), 6))
    for table, rows in zip(padded, tables, strict=True):
        table[: len(rows)] = rows
    return padded, counts


def _along_the_line(course: Course) -> Floats:
    """Return points around the course with the heading of its centre line."""
    samples = np.linspace(0, len(course.line), PLACES, endpoint=False).astype(int)
    rows = []
    for sample in samples:
        x, y, heading, _ = course.line[sample]
        room = OFF_LINE_SHARE * float(course.half_widths[sample].min())
        for offset in (-0.5 * room, 0.5 * room):
            px, py = x - offset * np.sin(heading), y + offset * np.cos(heading)
            rows.append((px, px, py, py, heading, SPREAD))
    return np.array(rows)
