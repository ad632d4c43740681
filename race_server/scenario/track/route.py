"""Courses packed into flat arrays for the kernels: lines, gates and places."""

from collections.abc import Sequence

import numpy as np

from race_server.core.state import COURSE, GATE, LINE, REFERENCE, Records, Route
from race_server.scenario.track.course import Course
from race_server.scenario.track.line import ReferenceLine


def pack_route(courses: Sequence[Course], references: Sequence[ReferenceLine | None] = ()) -> Route:
    """Return the courses behind one another; course c of a race's rules is `courses[c]`.

    references: the line to drive along on each course, or none at all.
    """
    references = references or [None] * len(courses)
    headers = np.zeros(len(courses), COURSE)
    lines, paths, gates = [], [], []
    starts = {"line": 0, "gate": 0, "grid": 0, "spot": 0}
    for header, course, reference in zip(headers, courses, references, strict=True):
        header.spacing, header.length, header.kerb = course.spacing, course.length, course.kerb
        header.verge = course.kerb + course.grass
        header.reference_spacing = reference.spacing if reference else 0.0
        counts = {
            "line": len(course.line),
            "gate": len(course.gates),
            "grid": len(course.grid),
            "spot": len(course.spots),
        }
        for name, count in counts.items():
            header[f"{name}_start"], header[f"{name}_count"] = starts[name], count
            starts[name] += count
        lines.append(_line_of(course))
        paths.append(_reference_of(course, reference))
        gates.append(_gates_of(course))
    return Route(
        courses=headers,
        line=np.concatenate(lines),
        reference=np.concatenate(paths),
        gates=np.concatenate(gates),
        grid=np.concatenate([course.grid for course in courses]),
        spots=np.concatenate([course.spots.reshape(-1, 2) for course in courses]),
    )


def _line_of(course: Course) -> Records:
    line = np.zeros(len(course.line), LINE)
    for column, name in enumerate(("x", "y", "heading", "curvature")):
        line[name] = course.line[:, column]
    line["cos"], line["sin"] = np.cos(line["heading"]), np.sin(line["heading"])
    line["left"], line["right"] = course.half_widths.T
    return line


def _reference_of(course: Course, reference: ReferenceLine | None) -> Records:
    path = np.zeros(len(course.line), REFERENCE)
    if reference is not None:
        for name in ("x", "y", "heading", "curvature", "speed", "held", "left", "right", "beside"):
            path[name] = getattr(reference, name)
        path["cos"], path["sin"] = np.cos(path["heading"]), np.sin(path["heading"])
    return path


def _gates_of(course: Course) -> Records:
    gates = np.zeros(len(course.gates), GATE)
    gates["progress"] = course.gates
    if not len(gates):
        return gates  # of a car park
    # A gate that ends a sector carries the sector's number; the timing line ends the last.
    ends = [gate for gate in course.sectors if gate != 0]
    for sector, gate in enumerate([*ends, 0], start=1):
        gates[gate]["sector"] = sector
    return gates
