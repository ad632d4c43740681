"""Where a point lies on a course: nearest sample, progress, lateral offset."""

import math

from race_server.core.kernels.jit import kernel
from race_server.core.state import Record, Route

# A point farther to a side of a sample than the border there, by this share of the width, is behind
# a wall from it.
BEHIND = 0.1


@kernel
def nearest_sample(route: Route, course: Record, x: float, y: float, start: int) -> int:
    """Return the sample of the centre line nearest to a point, going downhill from `start`.

    course: COURSE; x, y: the point [m]; start: sample, from 0 to less than the course's count.
    Downhill a kart that drives around the tip of a wall, while the centre line leads far around it,
    would stay at a sample behind the wall; then it is sought among those that it is beside.
    """
    index = _downhill(route, course, x, y, start)
    if course.verge == 0.0 and not _is_beside(route, course, index, x, y):
        return _nearest_beside(route, course, x, y, index)
    return index


@kernel
def _downhill(route: Route, course: Record, x: float, y: float, start: int) -> int:
    """Return the first sample from `start` on to which its neighbours are no nearer."""
    count, first = course.line_count, course.line_start
    index = start
    best = _square(route, first + index, x, y)
    for step in (1, -1):
        while True:
            following = (index + step) % count
            square = _square(route, first + following, x, y)
            if not square < best:  # nor where a place is none (NaN), which would never end
                break
            index, best = following, square
    return index


@kernel
def _is_beside(route: Route, course: Record, sample: int, x: float, y: float) -> bool:
    """Return whether no border lies between a point and a sample that it is abreast of."""
    line = route.line[course.line_start + sample]
    is_left = (y - line.y) * line.cos - (x - line.x) * line.sin > 0.0
    room = (line.left if is_left else line.right) + BEHIND * (line.left + line.right)
    return _square(route, course.line_start + sample, x, y) <= room * room


@kernel
def _nearest_beside(route: Route, course: Record, x: float, y: float, otherwise: int) -> int:
    """Return the nearest sample that a point is beside; `otherwise` where it is beside none."""
    index, best = otherwise, math.inf
    for candidate in range(course.line_count):
        square = _square(route, course.line_start + candidate, x, y)
        if square < best and _is_beside(route, course, candidate, x, y):
            index, best = candidate, square
    return index


@kernel
def nearest_sample_anywhere(route: Route, course: Record, x: float, y: float) -> int:
    """Return the sample of the centre line nearest to a point, out of all.

    course: COURSE; x, y: the point [m].
    """
    index = 0
    best = _square(route, course.line_start, x, y)
    for candidate in range(1, course.line_count):
        square = _square(route, course.line_start + candidate, x, y)
        if square < best:
            index, best = candidate, square
    return index


@kernel
def _square(route: Route, sample: int, x: float, y: float) -> float:
    """Return the square of the distance [m²] to a sample of the centre line.

    sample: in `route.line`; x, y: the point [m].
    """
    dx, dy = route.line[sample].x - x, route.line[sample].y - y
    return dx * dx + dy * dy


@kernel
def place_on_reference(route: Route, course: Record, x: float, y: float, start: int) -> float:
    """Return where a point is abreast of the reference line, as a fractional sample of it.

    course: COURSE; x, y: the point [m]; start: the nearest sample of the centre line. The search
    goes downhill from the sample abreast of it; the place is not negative and may lie just beyond
    the last sample.
    """
    count, first = course.line_count, course.line_start
    index = route.reference[first + start].beside
    best = _square_to_reference(route, first + index, x, y)
    for step in (1, -1):
        while True:
            following = (index + step) % count
            square = _square_to_reference(route, first + following, x, y)
            if not square < best:  # nor where a place is none (NaN), which would never end
                break
            index, best = following, square
    point = route.reference[first + index]
    along = (x - point.x) * point.cos + (y - point.y) * point.sin
    share = min(max(along / course.reference_spacing, -0.5), 0.5)
    return index + share if index + share >= 0.0 else index + share + count


@kernel
def _square_to_reference(route: Route, sample: int, x: float, y: float) -> float:
    """Return the square of the distance [m²] to a sample of the reference line.

    sample: in `route.reference`; x, y: the point [m].
    """
    dx, dy = route.reference[sample].x - x, route.reference[sample].y - y
    return dx * dx + dy * dy


@kernel
def progress_of(
    route: Route, course: Record, x: float, y: float, sample: int
) -> tuple[float, float]:
    """Return progress and lateral offset [m] of a point, given its nearest sample.

    course: COURSE; x, y: the point [m]; sample: of the centre line. Progress is in [0, length).
    Between samples the point is projected on the arc through the sample; it moves on by at most
    half a spacing.
    """
    line = route.line[course.line_start + sample]
    dx, dy = x - line.x, y - line.y
    along = dx * line.cos + dy * line.sin
    offset = dy * line.cos - dx * line.sin
    stretch = 1.0 - offset * line.curvature
    half = 0.5 * course.spacing
    if stretch > 0.1:
        along /= stretch
    along = min(max(along, -half), half)
    progress = sample * course.spacing + along
    if progress < 0.0:
        progress += course.length
    elif progress >= course.length:
        progress -= course.length
    return progress, offset


@kernel
def way_to(course: Record, progress: float, other: float) -> float:
    """Return how far `other` lies ahead of `progress`, the shorter way round [m]."""
    way = other - progress
    if way >= 0.5 * course.length:
        return way - course.length
    return way + course.length if way < -0.5 * course.length else way
