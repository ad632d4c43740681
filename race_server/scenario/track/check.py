"""Check whether a vehicle can race on a course."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from race_server.core.vehicles import Vehicle
from race_server.errors import ScenarioError
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.occupancy_map import OccupancyMap
from race_server.scenario.track.passage import blocked_at
from race_server.scenario.track.polyline import (
    corners_of_box,
    crossings,
    is_inside,
    nearest_on,
    segments_of,
)

# Free width that a vehicle needs beside its own, as a share of it: that of the margins on both
# sides of a reference line.
ROOM = 0.53
# By so much a border may lie inside a wall of the map: pixels, and share of the half-width. Beside
# the tip of a wall the width jumps: the widest place within this share of the width counts.
PIXELS_INSIDE, SHARE_INSIDE, NEARBY = 2.0, 0.05, 0.15
# Two stretches merge where the edge of one is nearer to the line of the other than this share of
# its half-width. Edges are compared at steps of this share of the mean width.
MERGE_SHARE, MERGE_STEP = 0.8, 0.1


@dataclass(frozen=True)
class CourseIssue:
    """An error or a warning about a course."""

    level: str  # error or warning
    what: str


def check_course(
    course: Course, vehicle: Vehicle, occupancy: OccupancyMap | None = None
) -> list[CourseIssue]:
    """Return all errors and warnings; none for a good course.

    occupancy: the map that it was drawn after, to compare it with.
    """
    return [
        *(_in_walls(course, vehicle, occupancy) if occupancy else ()),
        *_open_borders(course),
        *_crossing_borders(course),
        *_narrow_places(course, vehicle),
        *_blocked_places(course, vehicle),
        *_tight_bends(course, vehicle),
        *_merging_stretches(course),
        *_start_grid(course, vehicle),
        *_outside_borders(course),
    ]


def require_passable(course: Course, vehicle: Vehicle) -> None:
    """Check that a vehicle fits through a course and around its bends.

    Raises:
        ScenarioError: it does not.
    """
    for issue in (*_narrow_places(course, vehicle), *_tight_bends(course, vehicle)):
        if issue.level == "error":
            raise ScenarioError(
                f"course {course.name}: {issue.what}; choose another course or vehicle"
            )


def _in_walls(course: Course, vehicle: Vehicle, occupancy: OccupancyMap) -> list[CourseIssue]:
    """Compare the line and the half-widths with the free pixels of a map."""
    name, line = occupancy.file.path.name, course.line[:, :2]
    blocked = ~occupancy.is_free(line)
    if blocked.any():
        x, y = line[blocked][0]
        return [
            CourseIssue(
                "error",
                f"{blocked.sum()} of {len(line)} samples of the line lie in a wall of {name}, the "
                f"first at ({x:.2f}, {y:.2f})",
            )
        ]
    free = _free_beside(course, occupancy)
    found = []
    reach = round(NEARBY * course.width_mean / course.spacing)
    nearby = np.max([np.roll(free, shift, axis=0) for shift in range(-reach, reach + 1)], axis=0)
    slack = PIXELS_INSIDE * occupancy.file.resolution + SHARE_INSIDE * course.half_widths
    inside = course.half_widths - nearby
    worst, side = np.unravel_index(np.argmax(inside - slack), inside.shape)
    if inside[worst, side] > slack[worst, side]:
        x, y = line[worst]
        count = (inside > slack).any(axis=1).sum()
        found.append(
            CourseIssue(
                "error",
                f"the {('left', 'right')[side]} border at ({x:.2f}, {y:.2f}) lies "
                f"{inside[worst, side]:.2f} m inside a wall of {name}, as it does at {count} of "
                f"{len(line)} samples",
            )
        )
    narrowest = int(np.argmin(free.sum(axis=1)))
    width, needed = float(free[narrowest].sum()), (1.0 + ROOM) * vehicle.width
    if width < needed:
        x, y = line[narrowest]
        what = f"{name} is {width:.2f} m wide at ({x:.2f}, {y:.2f}); {vehicle.name} needs"
        found.append(CourseIssue("error", f"{what} {needed:.2f} m"))
    return found


def _free_beside(course: Course, occupancy: OccupancyMap) -> Floats:
    """Return how far it is to a wall of the map from each sample, left and right (N, 2) [m]."""
    heading = course.line[:, 2]
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    reach = 1.5 * float(course.half_widths.max())
    sides = [occupancy.ranges_to_walls(course.line[:, :2], way, reach) for way in (left, -left)]
    return np.column_stack(sides)


def _open_borders(course: Course) -> list[CourseIssue]:
    """Return places where the end of a wall is not the start of another."""
    starts, ends = course.borders[:, :2], course.borders[:, 2:]
    gaps, _ = nearest_on(np.hstack([starts, starts]), ends)
    return [
        CourseIssue("error", f"the border is open at ({x:.2f}, {y:.2f}): a gap of {gap:.2f} m")
        for (x, y), gap in zip(ends[gaps > 1e-6], gaps[gaps > 1e-6], strict=True)
    ]


def _crossing_borders(course: Course) -> list[CourseIssue]:
    pairs = crossings(course.borders)
    if not len(pairs):
        return []
    x, y = course.borders[pairs[0, 0], :2]
    return [CourseIssue("error", f"the borders cross near ({x:.2f}, {y:.2f})")]


def _narrow_places(course: Course, vehicle: Vehicle) -> list[CourseIssue]:
    needed = (1.0 + ROOM) * vehicle.width
    if course.width_min < needed:
        return [
            CourseIssue(
                "error",
                f"{course.width_min:.2f} m wide at the narrowest; {vehicle.name} needs "
                f"{needed:.2f} m",
            )
        ]
    if course.width_min < 2.0 * needed:
        return [CourseIssue("warning", f"two {vehicle.name} cannot pass where it is narrowest")]
    return []


def _blocked_places(course: Course, vehicle: Vehicle) -> list[CourseIssue]:
    needed = (1.0 + ROOM) * vehicle.width
    if not course.obstacles or course.width_min < needed:
        return []
    if (blocked := blocked_at(course, needed)) is None:
        return []
    x, y = course.line[blocked[0], :2]
    left = min(blocked[1], needed - 0.01)  # less than needed in two digits, too
    what = f"obstacles leave {left:.2f} m to pass at ({x:.2f}, {y:.2f}); {vehicle.name} needs"
    return [CourseIssue("error", f"{what} {needed:.2f} m: move them, or make them smaller")]


def _tight_bends(course: Course, vehicle: Vehicle) -> list[CourseIssue]:
    """Compare each bend with the turning radius.

    A bend over an angle may be taken wider than its centre line: on a line that uses the free
    width w the radius grows by up to w/2 beside the centre, and by cutting a bend of angle a by
    another (w/2) / (1/cos(a/2) - 1). The angle is that of the line's turn over the vehicle's own
    turning circle.
    """
    samples = max(round(2.0 * vehicle.turning_radius / course.spacing), 1)
    turn = np.unwrap(course.line[:, 2])
    lap = turn[-1] + course.line[-1, 3] * course.spacing - turn[0]
    laps, places = np.divmod(np.arange(len(turn)) + samples, len(turn))
    ahead = turn[places] + laps * lap
    angle = np.clip(np.abs(ahead - turn), 1e-3, np.pi - 1e-3)
    room = 0.5 * np.maximum(course.half_widths.sum(axis=1) - vehicle.width, 0.0)
    tightest = 1.0 / np.maximum(np.abs(course.line[:, 3]), 1e-9)
    possible = tightest + room + room / (1.0 / np.cos(0.5 * angle) - 1.0)
    worst = int(np.argmin(possible))
    if possible[worst] < vehicle.turning_radius:
        x, y = course.line[worst, :2]
        return [
            CourseIssue(
                "error",
                f"the bend at ({x:.2f}, {y:.2f}) allows {possible[worst]:.2f} m; {vehicle.name} "
                f"turns in {vehicle.turning_radius:.2f} m: it cannot be lapped",
            )
        ]
    return []


def _merging_stretches(course: Course) -> list[CourseIssue]:
    """Return the first edge of the asphalt that lies well inside that of another stretch.

    No border stands there: borders end where two of them would cross.
    """
    step = max(round(MERGE_STEP * course.width_mean / course.spacing), 1)
    line, widths = course.line[::step], course.half_widths[::step]
    cos, sin = np.cos(line[:, 2]), np.sin(line[:, 2])
    numbers = np.arange(len(line))
    for side, edge in enumerate(course.edges()):
        for n, (x, y) in enumerate(edge[::step]):
            dx, dy = x - line[:, 0], y - line[:, 1]
            ahead = np.abs(numbers - n)
            # Inside a tight bend an edge folds over that of the same bend.
            along = np.minimum(ahead, len(line) - ahead) * step * course.spacing
            width = np.where(cos * dy - sin * dx > 0.0, widths[:, 0], widths[:, 1])
            within = (np.hypot(dx, dy) < MERGE_SHARE * width) & (along > np.pi * widths[n, side])
            if within.any():
                other = int(np.argmax(within))
                return [
                    CourseIssue(
                        "warning",
                        f"the asphalt of the stretches at ({line[n, 0]:.2f}, {line[n, 1]:.2f}) and "
                        f"({line[other, 0]:.2f}, {line[other, 1]:.2f}) overlaps, and no border "
                        "stands between them: make them narrower, or move them apart",
                    )
                ]
    return []


def _start_grid(course: Course, vehicle: Vehicle) -> list[CourseIssue]:
    if not len(course.grid):
        return [CourseIssue("error", "no place for a start grid")]
    clear, _ = nearest_on(course.borders, course.grid[:, :2])
    tight = int(np.sum(clear < 0.5 * vehicle.width))
    found = []
    if tight:
        found.append(CourseIssue("error", f"{tight} grid places are too near to a border"))
    steps = np.hypot(*(course.grid[1:, :2] - course.grid[:-1, :2]).T)
    if len(steps) and steps.min() < vehicle.width:
        what = f"two grid places are {steps.min():.2f} m apart, and {vehicle.name} is"
        way_out = "lower grid_places" if vehicle.is_model_car else 'give the course scale = "kart"'
        found.append(CourseIssue("error", f"{what} {vehicle.width:.2f} m wide: {way_out}"))
    return found


def _outside_borders(course: Course) -> list[CourseIssue]:
    """Return the starts, item boxes and slots that are not wholly between the borders."""
    starts = [
        corners_of_box(0.5 * (x0 + x1), 0.5 * (y0 + y1), 0.0, x1 - x0, y1 - y0)
        for x0, x1, y0, y1 in course.starts[:, :4].tolist()
    ]
    slots = [corners_of_box(*slot) for slot in course.lot.slots.tolist()] if course.lot else []
    kinds = (("starts", starts), ("items", list(course.spots[:, None])), ("slots", slots))
    found = []
    for name, places in kinds:
        if outside := _outside(course, places):
            x, y = places[outside[0]].mean(axis=0)
            found.append(
                CourseIssue(
                    "error",
                    f"{len(outside)} of {len(places)} {name} reach out of the borders, number "
                    f"{outside[0] + 1} at ({x:.2f}, {y:.2f}); move them between the borders",
                )
            )
    return found


def _outside(course: Course, places: Sequence[Floats]) -> list[int]:
    """Return which polygons, (3 or more, 2) or one point (1, 2) [m], are not between the borders.

    Those are inside an odd number of the loops that the borders make.
    """
    if not places:
        return []
    owner = np.repeat(np.arange(len(places)), [len(place) for place in places])
    outside = set(owner[~is_inside(np.concatenate(places), course.borders)].tolist())
    sides = np.concatenate([segments_of(place) for place in places])
    for border, side in crossings(np.concatenate([course.borders, sides])).tolist():
        if border < len(course.borders) <= side:
            outside.add(int(owner[side - len(course.borders)]))
    return sorted(outside)
