"""The reference line of a race: every scenario gets it here."""

from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from race_server.core.vehicles import Vehicle
from race_server.errors import RaceError
from race_server.scenario.raceline.bounds import Bounds, bounds_of
from race_server.scenario.raceline.detour import around
from race_server.scenario.raceline.profile import speeds_on
from race_server.scenario.raceline.reference import known_limit, reference_limit
from race_server.scenario.raceline.result import Raceline
from race_server.scenario.raceline.turning_over import slowed
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.line import ReferenceLine
from race_server.scenario.track.polyline import loops_of, nearest_on

if TYPE_CHECKING:
    # Scenarios import kernels, and so a compiler; to look up a line takes neither.
    from race_server.scenario.race import Scenario


def with_line(scenario: "Scenario", *, solve: bool = False) -> "Scenario":
    """Return the scenario with the reference line of its course and its first vehicle."""
    line = scenario.line
    if line is not None and not (solve and line.note):
        return scenario
    line = reference_line(scenario.course, scenario.vehicle_of(0), solve=solve)
    return replace(scenario, line=line)


def reference_line(course: Course, vehicle: Vehicle, *, solve: bool = False) -> ReferenceLine:
    """Return the reference line of a vehicle on a course.

    That is the lap of minimum time that keeps more room the faster it is and turns over as fast as
    a body can follow, if it is known: bundled, or in the user's cache. solve: compute it
    otherwise, once; that takes seconds and needs CasADi, so ask for it only if a driver needs the
    line. Without it the centre line is used in its place, with the speeds that it allows, and the
    line's `note` says so in one sentence. Both are led around the course's fixed obstacles.
    """
    return _line_on(course, vehicle, solve)


@lru_cache(maxsize=64)
def _line_on(course: Course, vehicle: Vehicle, solve: bool) -> ReferenceLine:
    bounds = bounds_of(vehicle)
    line = around(course, _free_line(course, vehicle, bounds, solve), bounds, vehicle)
    return replace(line, speed=slowed(line.speed, line.curvature, line.spacing, bounds))


def _free_line(course: Course, vehicle: Vehicle, bounds: Bounds, solve: bool) -> ReferenceLine:
    """Return the line of a course without its obstacles."""
    try:
        limit = reference_limit(course, vehicle) if solve else known_limit(course, bounds)
    except RaceError as error:
        return stand_in(course, bounds, f"{error}; the centre line stands in as reference line")
    if limit is None:
        note = (
            f"{course.name}: no reference limit is known for {vehicle.name}, so the centre line "
            f"stands in as reference line; `race limit {course.name} --vehicle {vehicle.name}` "
            "finds it"
        )
        return stand_in(course, bounds, note)
    return line_of(course, limit.with_room)


def line_of(course: Course, reference: Raceline) -> ReferenceLine:
    """Return a line of the reference limit at equal steps."""
    count = len(course.line)
    at = np.append(reference.distance, reference.length)
    wanted = np.linspace(0.0, at[-1], count, endpoint=False)
    x, y = _curve(at, reference, wanted)
    spacing = float(at[-1]) / count
    samples = np.interp(
        np.arange(count) * course.spacing, np.append(reference.progress, course.length), at
    )
    left = _between(at, _closed(reference.left), wanted)
    right = _between(at, _closed(reference.right), wanted)
    heading = _between(at, np.unwrap(_closed(reference.heading)), wanted)
    if course.kerb + course.grass == 0.0:
        to_left, to_right = _ways_to_borders(course, np.column_stack([x, y]), heading)
        left, right = np.minimum(left, to_left), np.minimum(right, to_right)
    return ReferenceLine(
        spacing=spacing,
        x=x,
        y=y,
        heading=heading,
        curvature=_between(at, _closed(reference.curvature), wanted),
        speed=np.sqrt(_between(at, _closed(reference.speed**2), wanted)),
        left=left,
        right=right,
        beside=np.round(samples / spacing).astype(np.int64) % count,
    )


def _ways_to_borders(course: Course, points: Floats, heading: Floats) -> tuple[Floats, Floats]:
    """Return how far [m] it is from points (N, 2) of a line to its left and to its right border.

    heading: (N,) of the line [rad]. Straight across the centre line a border may look farther away
    than it is: beside the tip of a wall, and where the line crosses the course.
    """
    left, right = np.full(len(points), np.inf), np.full(len(points), np.inf)
    for loop in loops_of(course.borders):
        way, met = nearest_on(loop, points)
        away = met - points
        aside = np.cos(heading) * away[:, 1] - np.sin(heading) * away[:, 0]
        side = left if aside[np.argmin(way)] > 0.0 else right
        np.minimum(side, way, out=side)
    return left, right


def stand_in(course: Course, bounds: Bounds, note: str) -> ReferenceLine:
    """Return the centre line with the fastest speeds that its bends allow."""
    count = len(course.line)
    x, y, heading, curvature = course.line.T
    left, right = course.half_widths.T
    return ReferenceLine(
        spacing=course.spacing,
        x=x,
        y=y,
        heading=heading,
        curvature=curvature,
        speed=speeds_on(np.full(count, course.spacing), curvature, bounds),
        left=left,
        right=right,
        beside=np.arange(count),
        note=note,
    )


def _closed(values: Floats) -> Floats:
    return np.append(values, values[0])


def _between(at: Floats, values: Floats, wanted: Floats) -> Floats:
    return np.asarray(np.interp(wanted, at, values))


def _curve(at: Floats, reference: Raceline, wanted: Floats) -> tuple[Floats, Floats]:
    """Return x and y at distances along a line: cubics that keep its points and headings."""
    index = np.clip(np.searchsorted(at, wanted, side="right") - 1, 0, len(reference.x) - 1)
    following = (index + 1) % len(reference.x)
    step = at[index + 1] - at[index]
    share = (wanted - at[index]) / step
    start = (1.0 + 2.0 * share) * (1.0 - share) ** 2
    leaving = step * share * (1.0 - share) ** 2
    arriving = step * share**2 * (share - 1.0)
    curves = []
    for values, ways in (
        (reference.x, np.cos(reference.heading)),
        (reference.y, np.sin(reference.heading)),
    ):
        ends = start * values[index] + (1.0 - start) * values[following]
        curves.append(ends + leaving * ways[index] + arriving * ways[following])
    return curves[0], curves[1]
