"""The same course, driven the other way round."""

from dataclasses import replace

import numpy as np

from race_server.scenario.track.course import Course, Floats


def reversed_course(course: Course) -> Course:
    """Return the course with its direction of travel reversed; walls stay where they are.

    The timing line stays; the other gates, the sectors and the grid are mirrored about it.
    """
    # Sample 0 stays at progress 0, the others follow backwards.
    order = np.concatenate([[0], np.arange(len(course.line) - 1, 0, -1)])
    line = course.line[order].copy()
    line[:, 2] = _turned(line[:, 2])
    line[:, 3] *= -1.0
    mirrored = np.sort(course.length - course.gates[1:])
    gates = np.concatenate([course.gates[:1], mirrored])
    count = len(course.gates)
    return replace(
        course,
        name=f"{course.name}-reversed",
        title=f"{course.title}, reversed",
        line=line,
        half_widths=course.half_widths[order][:, ::-1].copy(),
        gates=gates,
        sectors=(*sorted(count - gate for gate in course.sectors if gate), 0),
        grid=_mirrored_grid(course, line),
        starts=_turned_starts(course.starts),
        digest=f"{course.digest}-reversed",
    )


def _turned(heading: Floats) -> Floats:
    return (heading + 2.0 * np.pi) % (2.0 * np.pi) - np.pi


def _mirrored_grid(course: Course, line: Floats) -> Floats:
    """Return the grid places as far before the timing line as they were, on the other side."""
    grid = course.grid.copy()
    for place in grid:
        nearest = int(np.argmin(np.hypot(*(course.line[:, :2] - place[:2]).T)))
        x, y, heading, _ = course.line[nearest]
        offset = (place[1] - y) * np.cos(heading) - (place[0] - x) * np.sin(heading)
        # The line is a ring: sample n of the one is sample -n of the other.
        there = line[nearest]
        place[0] = there[0] - offset * np.sin(there[2])
        place[1] = there[1] + offset * np.cos(there[2])
        place[2] = there[2]
    return grid


def _turned_starts(starts: Floats) -> Floats:
    turned = starts.copy()
    turned[:, 4] = _turned(turned[:, 4])
    return turned
