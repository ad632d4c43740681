"""A course from a closed lap of scans: its borders, its centre line, and the line to race.

`python -m race_agents.planning.charted_course` solves what it reads, so that the process that
drives is never kept waiting.
"""

import os
import pickle
import subprocess
import sys
from dataclasses import dataclass, replace

import numpy as np

from race_agents.planning.lap_survey import path_of, wall_map_of
from race_agents.planning.seen_through import walls_unseen
from race_agents.planning.wall_map import Pose, Scan, WallMap
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle
from race_server.errors import PlanError, RaceError
from race_server.scenario.raceline.attach import line_of, stand_in
from race_server.scenario.raceline.bounds import bounds_of
from race_server.scenario.raceline.program import ROUGH, load_casadi
from race_server.scenario.raceline.result import raceline_of
from race_server.scenario.raceline.solution import Search, fastest_of
from race_server.scenario.track.build import SCALES, TrackSpec, build
from race_server.scenario.track.corridor import strip_between
from race_server.scenario.track.course import Course
from race_server.scenario.track.limits import MOST_POINTS
from race_server.scenario.track.line import ReferenceLine
from race_server.scenario.track.medial import medial_line
from race_server.scenario.track.polyline import (
    area_of,
    derivatives,
    lengths_of,
    nearest_on,
    resample,
    segments_of,
    smooth,
)

# Steps of a path and of a border [cells], and how far a wall beside it counts [cells].
STEP, FARTHEST = 0.25, 60.0
# Standard deviation [cells] that takes the noise off a border.
SOFT = 0.4
# Scans that must have seen a piece of wall.
SEEN = 2
# Free room [widths of the vehicle] between body and border beside what every line keeps: the map's
# error, that of a pose and that of the steering come off it, and borders are smoothed. Where a
# course is too narrow for that, the line has LEAST [m] to each side of the middle.
MORE_ROOM, LEAST = 0.537, 0.01
# Rounds in which every scan is fitted among all others, and the trust in its pose [m], [rad].
REFINING, TRUST = 2, (0.1, 0.02)


@dataclass(frozen=True, eq=False)
class Chart:
    """A course that was driven once, with the walls to find a pose by."""

    points: Floats  # (N, 2) [m] of pieces of wall
    normals: Floats  # (N, 2)
    course: Course
    line: ReferenceLine


def refine(scans: list[Scan], poses: list[Pose], cell: float) -> list[Pose]:
    """Return poses after each scan was fitted among the scans of the whole lap."""
    for _ in range(REFINING):
        walls = wall_map_of(scans, poses, cell)
        fits = [walls.match(scan, pose, TRUST) for scan, pose in zip(scans, poses, strict=True)]
        poses = [fit.pose if fit.share > 0.5 else old for fit, old in zip(fits, poses, strict=True)]
    return poses


def borders_along(path: Floats, walls: WallMap) -> tuple[Floats, Floats]:
    """Return the closed borders left and right of a closed path, each (M, 2) [m].

    path: (N, 2) [m] in the direction of travel. A piece of wall is left or right of the nearest
    place of the path that its free side faces. Pieces follow one another as the triangles between
    the two sides do, so that an alcove is left out where walls across are nearer.

    Raises:
        PlanError: one side has hardly any walls.
        TrackError: the walls of a side do not lead around.
    """
    from matplotlib.tri import Triangulation

    line = resample(path, max(round(lengths_of(path).sum() / (STEP * walls.cell)), 32))
    line = smooth(line, 2.0 / STEP)
    heading, _ = derivatives(line)
    seen = walls.counts >= SEEN
    offset = _beside(line, heading, walls.points[seen], walls.normals[seen], FARTHEST * walls.cell)
    points, offset = walls.points[seen][offset != 0.0], offset[offset != 0.0]
    if min(np.sum(offset > 0.0), np.sum(offset < 0.0)) < 16:
        raise PlanError("the lap shows no walls on one side of its path")
    net = Triangulation(*points.T)
    strip = strip_between(net.triangles, net.neighbors, offset > 0.0)
    # Each triangle of the strip adds the corner that the one before it does not have.
    added = [
        next(corner for corner in triangle if corner not in before)
        for before, triangle in zip(np.roll(strip, 1, axis=0).tolist(), strip.tolist(), strict=True)
    ]
    sides = []
    for side in (1.0, -1.0):
        border = points[[corner for corner in added if side * offset[corner] > 0.0]]
        if (area_of(border) > 0.0) != (area_of(path) > 0.0):
            border = border[::-1]
        sides.append(_evened(border, walls.cell))
    return sides[0], sides[1]


def _beside(line: Floats, heading: Floats, points: Floats, normals: Floats, most: float) -> Floats:
    """Return the offset [m] of each wall from the place of a line that it faces, 0 for none."""
    left = np.column_stack([-np.sin(heading), np.cos(heading)])
    offset = np.zeros(len(points))
    for index, (point, normal) in enumerate(zip(points, normals, strict=True)):
        away = point - line
        square = np.sum(away * away, axis=1)
        square[away @ normal >= 0.0] = np.inf
        best = int(np.argmin(square))
        if square[best] < most * most:
            offset[index] = away[best] @ left[best]
    return offset


def _evened(border: Floats, cell: float) -> Floats:
    """Return a border at equal steps without the noise of its points."""
    keep = np.hypot(*(border - np.roll(border, 1, axis=0)).T) > 0.2 * cell
    border = border[keep]
    even = resample(border, max(round(lengths_of(border).sum() / cell), 16))
    even = smooth(even, SOFT)
    return resample(even, max(round(lengths_of(even).sum() / cell), 16))


def points_between(left: Floats, right: Floats, path: Floats, scale: str) -> Floats:
    """Return the centre line between two closed borders, in the direction of a path along them.

    Its points are those of a course file: (N, 4) x, y, half-width left, half-width right [m]. The
    first is nearest to the beginning of the path.

    Raises:
        RaceError: no course fits between them.
    """
    outer, inner = (right, left) if area_of(path) > 0.0 else (left, right)
    line, _ = medial_line(outer, inner, SCALES[scale].spacing)
    if (area_of(line) > 0.0) != (area_of(path) > 0.0):
        line = line[::-1]
    line = smooth(line, 3.0)
    start = int(np.argmin(np.hypot(*(line - path[0]).T)))
    line = np.roll(line, -start, axis=0)
    count = min(max(round(len(line) / 4), 32), MOST_POINTS)
    line = resample(line, count)
    widths = [nearest_on(segments_of(side), line)[0] for side in (left, right)]
    return np.column_stack([line, *widths])


def course_between(left: Floats, right: Floats, path: Floats, scale: str) -> Course:
    """Return the course between two closed borders, in the direction of a path along them.

    Raises:
        RaceError: no course fits between them.
    """
    plan = TrackSpec(
        name="surveyed",
        title="Surveyed",
        form="line",
        scale=scale,
        digest="",
        points=points_between(left, right, path, scale),
    )
    return replace(build(plan), borders=np.concatenate([segments_of(left), segments_of(right)]))


def line_on(course: Course, vehicle: Vehicle) -> ReferenceLine:
    """Return the line to race; the centre line where nothing solves it."""
    bounds = bounds_of(vehicle)
    search = Search(MORE_ROOM * vehicle.width, LEAST, ROUGH, follows=True)
    try:
        load_casadi()
        found = fastest_of(course, bounds, search)
    except RaceError as error:
        return stand_in(course, bounds, f"{error}; the centre line stands in for the line to race")
    return line_of(course, raceline_of(found.frame, bounds, found.best))


def walled_path(scans: list[Scan], poses: list[Pose], cell: float) -> tuple[Floats, WallMap]:
    """Return the path (N, 2) [m] of a lap whose poses close, once around, and the walls beside it.

    cell: size of a piece of wall [m].
    """
    walls = wall_map_of(scans, poses, cell)
    path = path_of(poses)
    # What lies beyond the start is on the path already.
    beyond = np.hypot(*(path - path[0]).T)
    last = len(path) // 2 + int(np.argmin(beyond[len(path) // 2 :]))
    return path[: max(last, 8)], walls


def scale_of(vehicle: Vehicle) -> str:
    """Return the scale of the courses that a vehicle drives."""
    return "1/10" if vehicle.is_model_car else "kart"


def chart_lap(scans: list[Scan], poses: list[Pose], cell: float, vehicle: Vehicle) -> Chart:
    """Return the course of a lap whose poses close, and the line to race on it.

    Raises:
        RaceError: no course fits.
    """
    poses = refine(scans, poses, cell)
    path, walls = walled_path(scans, poses, cell)
    left, right = borders_along(path, walls)
    course = course_between(left, right, path, scale_of(vehicle))
    tips = walls_unseen(scans, poses, left, right, cell)
    course = replace(course, borders=np.concatenate([course.borders, tips]))
    line = line_on(course, vehicle)
    if len(tips):
        off, _ = nearest_on(tips, np.column_stack([line.x, line.y]))
        if off.min() < 0.5 * vehicle.width:
            raise PlanError("the line leads through what no ray went through")
    return Chart(walls.points, walls.normals, course, line)


def ask_chart(scans: list[Scan], poses: list[Pose], cell: float, vehicle: Vehicle) -> Chart:
    """Return what `chart_lap` finds, made by another process.

    Raises:
        PlanError: it found none.
    """
    command = [sys.executable, "-m", "race_agents.planning.charted_course"]
    task = pickle.dumps((scans, poses, cell, vehicle))
    interpreted = {**os.environ, "RACE_SERVER_INTERPRET": "1"}  # no kernel runs there
    done = subprocess.run(command, env=interpreted, input=task, stdout=subprocess.PIPE, check=False)
    try:
        answer = pickle.loads(done.stdout)
    except (EOFError, pickle.UnpicklingError) as error:
        raise PlanError(f"the process that charts a lap ended with {done.returncode}") from error
    if isinstance(answer, RaceError):
        raise PlanError(str(answer))
    assert isinstance(answer, Chart)
    return answer


def _main() -> None:
    answers = sys.stdout.buffer
    sys.stdout = sys.stderr
    os.nice(5)
    try:
        answer: object = chart_lap(*pickle.load(sys.stdin.buffer))
    except RaceError as error:
        answer = error
    pickle.dump(answer, answers)
    answers.flush()


if __name__ == "__main__":
    # Under its own name, so that what is pickled here is found there.
    from race_agents.planning.charted_course import _main as main

    main()
