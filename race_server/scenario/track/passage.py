"""Whether obstacles on a course leave a way around it: gaps across its line."""

from collections.abc import Iterable

import numpy as np

from race_server.scenario.track.course import Course, Floats, Obstacle
from race_server.scenario.track.polyline import corners_of_box

Gap = tuple[float, float]  # from the right to the left of the line [m], left positive


def blocked_at(course: Course, needed: float) -> tuple[int, float] | None:
    """Return the sample of the line behind which no way goes on, and how wide it is there [m].

    None where a way leads around. At each sample the obstacles are taken off the width between the
    borders that stand within half of `needed` [m] before or behind it.
    """
    covered = _covered(course, max(course.spacing, 0.5 * needed))
    count, beyond = len(course.line), course.kerb + course.grass
    first = next((sample for sample in range(count) if sample not in covered), 0)
    reached: list[Gap] = [(-np.inf, np.inf)]
    for sample in (*range(first, count), *range(first)):
        if sample not in covered:
            reached = [(-np.inf, np.inf)]
            continue
        left, right = (course.half_widths[sample] + beyond).tolist()
        ahead = [
            gap
            for gap in _gaps(-right, left, covered[sample])
            if any(gap[0] < high and low < gap[1] for low, high in reached)
        ]
        reached = [(low, high) for low, high in ahead if high - low >= needed]
        if not reached:
            return sample, max((high - low for low, high in ahead), default=0.0)
    return None


def _covered(course: Course, reach: float) -> dict[int, list[Gap]]:
    """Return what obstacles cover across the line, by the sample that they stand beside.

    reach: so far [m] before and behind a sample.
    """
    covered: dict[int, list[Gap]] = {}
    sides = course.half_widths + course.kerb + course.grass
    for obstacle in course.obstacles:
        away = np.hypot(*(course.line[:, :2] - (obstacle.x, obstacle.y)).T)
        radius = 0.5 * np.hypot(obstacle.length, obstacle.width)
        near = np.flatnonzero(away <= radius + reach + sides.max(axis=1))
        low, high = _across(course.line[near], obstacle, reach)
        stands = (low < sides[near, 0]) & (high > -sides[near, 1])
        for sample, start, end in zip(near[stands], low[stands], high[stands], strict=True):
            covered.setdefault(int(sample), []).append((float(start), float(end)))
    return covered


def _across(line: Floats, obstacle: Obstacle, reach: float) -> tuple[Floats, Floats]:
    """Return from where to where a box covers strips across samples of the line, (N,) each [m].

    line: (N, 4) as `Course.line`; reach: half the width of a strip [m]. Where the box is not in a
    strip the first is infinite and the second minus infinite.
    """
    corners = corners_of_box(
        obstacle.x, obstacle.y, obstacle.heading, obstacle.length, obstacle.width
    )
    offset = corners - line[:, None, :2]
    cos, sin = np.cos(line[:, 2:3]), np.sin(line[:, 2:3])
    along = offset[:, :, 0] * cos + offset[:, :, 1] * sin
    across = offset[:, :, 1] * cos - offset[:, :, 0] * sin
    step, aside = np.roll(along, -1, axis=1) - along, np.roll(across, -1, axis=1) - across
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.sort(np.stack([(-reach - along) / step, (reach - along) / step]), axis=0)
    # A side that lies across the line is in the strip as a whole, or not at all.
    flat, within = step == 0.0, np.abs(along) <= reach
    enters = np.where(flat, 0.0, np.maximum(ends[0], 0.0))
    leaves = np.where(flat, np.where(within, 1.0, -1.0), np.minimum(ends[1], 1.0))
    places = np.stack([across + enters * aside, across + leaves * aside])
    is_in = enters <= leaves
    low = np.where(is_in, places.min(axis=0), np.inf).min(axis=1)
    return low, np.where(is_in, places.max(axis=0), -np.inf).max(axis=1)


def _gaps(low: float, high: float, covered: Iterable[Gap]) -> list[Gap]:
    """Return what is left of a range [m] without what is covered, in order."""
    gaps, at = [], low
    for start, end in sorted(covered):
        if start > at:
            gaps.append((at, min(start, high)))
        at = max(at, end)
    return [*gaps, (at, high)] if at < high else gaps
