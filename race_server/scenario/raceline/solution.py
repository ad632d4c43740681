"""The solution of a course: lines of least time, curvature and length, and their frame."""

import math
from dataclasses import dataclass

import numpy as np

from race_server.errors import TrackError
from race_server.scenario.raceline.baselines import (
    FOLD,
    STEEPEST,
    OffsetLine,
    centre_line,
    least_curved,
    shortest,
)
from race_server.scenario.raceline.bounds import Bounds
from race_server.scenario.raceline.frame import (
    DEEPEST,
    DEEPEST_BESIDE,
    Frame,
    frame_about,
    frame_of,
)
from race_server.scenario.raceline.minimum_time import TimedLine, fastest_lap
from race_server.scenario.raceline.program import EXACT
from race_server.scenario.raceline.result import (
    Limit,
    profile_of,
    raceline_at_best,
    raceline_of,
)
from race_server.scenario.track.course import Course

# A line this near to what a frame forbids is confined by it: 1 - offset · curvature, and shares of
# the depth to which it sees room and of the steepest bearing.
NEAR_FOLD, NEAR = 2.0 * FOLD, 0.98
# Nothing more is sought where less than this share of a lap's time was gained: other stations
# alone move it by as much.
GAINED = 0.001
# The second frame is nearly always the last: a line lies in the middle of the one about itself.
MOST_FRAMES = 6
# Errors of a driver grow with its speed: a curvature that is off by k for a time T leads it astray
# by v² k T² / 2. So a lap to drive keeps v² times this [s²/m] free beside the margin, 5 cm at
# 10 m/s, but leaves this share of what there is.
ROOM, LEFT = 5e-4, 0.5


@dataclass(frozen=True)
class Search:
    """What is asked of a lap besides its time."""

    room: float = 0.0  # [m] kept free beside the borders, besides the margin
    least: float = 0.0  # [m] left to each side of the middle where a course is too narrow for that
    tolerance: float = EXACT
    follows: bool = False  # a body with a yaw inertia turns over as fast as the lap does


STRICT = Search()


@dataclass(frozen=True)
class Fastest:
    """The lap of minimum time, and where it was found."""

    frame: Frame
    calm: OffsetLine  # the least curved
    best: TimedLine


@dataclass(frozen=True)
class Solution(Fastest):
    """With the shortest line and one to drive, all that a limit needs of a solver."""

    near: OffsetLine
    with_room: TimedLine


def fastest_of(course: Course, bounds: Bounds, search: Search = STRICT) -> Fastest:
    """Return the lap of minimum time, wherever it leads between the borders.

    Track coordinates end at the centre of a bend and, in a room, where a frame sees no more. Where
    that confines a lap, stations are laid along it, and the next lap is sought beside it, until
    nothing is gained.

    Raises:
        RaceError: CasADi is not installed, or no line fits.
    """
    found = fastest_in(frame_of(course, bounds), bounds, search)
    # Between kerbs a frame about the centre line sees all of the asphalt.
    seen = DEEPEST * course.spacing if course.kerb + course.grass == 0.0 else math.inf
    for _ in range(MOST_FRAMES):
        if not _is_confined(found, seen - bounds.reach - search.room):
            break
        lap = raceline_of(found.frame, bounds, found.best)
        try:
            frame = frame_about(course, bounds, np.column_stack([lap.x, lap.y]), lap.progress)
            other = fastest_in(frame, bounds, search)
        except TrackError:
            break  # what is known is a lap, if not the fastest
        before = found.best.time_s
        if other.best.time_s < before:
            found, seen = other, DEEPEST_BESIDE * course.spacing
        if other.best.time_s > (1.0 - GAINED) * before:
            break
    return found


def fastest_in(frame: Frame, bounds: Bounds, search: Search = STRICT) -> Fastest:
    """Return the lap of minimum time in one frame.

    Raises:
        RaceError: CasADi is not installed, or no line fits.
    """
    inner = frame.narrowed(search.room, search.least)
    calm = least_curved(inner, bounds)
    _, speeds = profile_of(inner, calm, bounds)
    best = fastest_lap(
        inner, bounds, calm, speeds, tolerance=search.tolerance, follows=search.follows
    )
    return Fastest(frame, calm, best)


def with_room(found: Fastest, bounds: Bounds) -> TimedLine:
    """Return the lap of minimum time to drive: with more room the faster it is, as a body turns.

    How fast it is there is read off the lap without room, which is returned where none is found.
    """
    frame, best = found.frame, found.best
    inner = frame.narrowed(ROOM * best.speed**2, 0.5 * LEFT * (frame.high - frame.low))
    try:
        return fastest_lap(inner, bounds, best.line, best.speed, follows=True)
    except TrackError:
        return best


def _is_confined(found: Fastest, most: float) -> bool:
    """Return whether a lap comes near to what no wall but its frame forbids.

    most: [m] offset that the depth to which a frame sees room allows.
    """
    line = found.best.line
    return (
        float((line.offset * found.frame.curvature).max()) > 1.0 - NEAR_FOLD
        or float(np.abs(line.offset).max()) > NEAR * most
        or float(np.abs(line.bearing).max()) > NEAR * STEEPEST
    )


def solve(course: Course, bounds: Bounds) -> Solution:
    """Return the lines of least time, with room and without, least curvature and least length.

    Raises:
        RaceError: CasADi is not installed, or no line fits.
    """
    found = fastest_of(course, bounds)
    try:
        near = shortest(found.frame, bounds, found.calm)
    except TrackError:
        near = found.calm  # a lap is known: nothing shorter was found
    return Solution(found.frame, found.calm, found.best, near, with_room(found, bounds))


def limit_of(course: Course, bounds: Bounds, solution: Solution, solve_s: float) -> Limit:
    """Return the lines of a solution with the speeds that each allows."""
    frame, own = solution.frame, frame_of(course, bounds)
    return Limit(
        solve_s,
        raceline_of(frame, bounds, solution.best),
        raceline_of(frame, bounds, solution.with_room),
        raceline_at_best(frame, bounds, solution.calm),
        raceline_at_best(own, bounds, centre_line(own)),
        raceline_at_best(frame, bounds, solution.near),
    )
