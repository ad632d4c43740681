"""Rectangles on the ground, and what they touch: slots, bodies, blocks."""

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from race_server.scenario.lot.site import area_in, polygons_in
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.polyline import corners_of_box, is_inside
from race_server.scenario.track.walls import fence_of


@dataclass(frozen=True)
class Footprint:
    """A rectangle by its middle, its heading and its size."""

    x: float  # [m]
    y: float  # [m]
    heading: float  # [rad]
    length: float  # [m]
    width: float  # [m]

    @property
    def corners(self) -> Floats:
        """Its corners (4, 2) [m]."""
        return corners_of_box(self.x, self.y, self.heading, self.length, self.width)

    def grown(self, room: float) -> "Footprint":
        """Return it with `room` [m] more on every side, or less if that is negative."""
        length, width = max(self.length + 2.0 * room, 0.0), max(self.width + 2.0 * room, 0.0)
        return Footprint(self.x, self.y, self.heading, length, width)

    def overlaps(self, other: "Footprint") -> bool:
        """Return whether two rectangles overlap: no side of either separates them."""
        for one, two in ((self, other), (other, self)):
            corners = one._seen(two.corners)
            low, high = corners.min(axis=0), corners.max(axis=0)
            half = 0.5 * np.array([one.length, one.width])
            if (low >= half).any() or (high <= -half).any():
                return False
        return True

    def crosses(self, segments: Floats) -> NDArray[np.bool_]:
        """Return which segments (N, 4) come inside. Each is cut by the four sides in turn."""
        start, end = self._seen(segments[:, :2]), self._seen(segments[:, 2:])
        along = end - start
        half = 0.5 * np.array([self.length, self.width])
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            ways = np.stack([(-half - start) / along, (half - start) / along])
        # A segment along a side lies inside of that pair of sides for all of its way, or nowhere.
        flat, within = along == 0.0, np.abs(start) < half
        first = np.where(flat, np.where(within, -np.inf, np.inf), ways.min(axis=0))
        last = np.where(flat, np.where(within, np.inf, -np.inf), ways.max(axis=0))
        enters = np.maximum(first.max(axis=1), 0.0)
        return np.asarray(enters < np.minimum(last.min(axis=1), 1.0))

    def _seen(self, points: Floats) -> Floats:
        """Return points (N, 2) in the frame of the rectangle."""
        cos, sin = math.cos(self.heading), math.sin(self.heading)
        return np.asarray((points - (self.x, self.y)) @ np.array([[cos, -sin], [sin, cos]]))


@dataclass(frozen=True, eq=False)
class _Solids:
    """All that stands fixed in a car park, as loops."""

    names: list[str]
    loops: list[Floats]  # (N, 4) sides of each
    low: Floats  # (S, 2) least x and y of each [m]
    high: Floats  # (S, 2) [m]


@lru_cache(maxsize=4)
def _solids_in(course: Course) -> _Solids:
    polygons = polygons_in(course)
    boxes = fence_of(course).segments[len(course.borders) :].reshape(-1, 4, 4)
    loops = [*polygons, *boxes]
    names = [f"the polygon with a corner at ({x:.2f}, {y:.2f}) m" for x, y in _firsts(polygons)]
    names += [f"the obstacle at ({one.x:.2f}, {one.y:.2f}) m" for one in course.obstacles]
    low = np.array([loop[:, :2].min(axis=0) for loop in loops]).reshape(-1, 2)
    high = np.array([loop[:, :2].max(axis=0) for loop in loops]).reshape(-1, 2)
    return _Solids(names, loops, low, high)


def _firsts(loops: list[Floats]) -> list[list[float]]:
    return [loop[0, :2].tolist() for loop in loops]


def solids_in(course: Course) -> list[Floats]:
    """Return the sides (N, 4) [m] of each thing that stands fixed in a car park."""
    return _solids_in(course).loops


def wall_under(course: Course, place: Footprint) -> str:
    """Return the name of what a rectangle in a car park touches or lies in; empty for nothing."""
    area, middle, corners = area_in(course), np.array([[place.x, place.y]]), place.corners
    if place.crosses(area).any() or not is_inside(middle, area)[0]:
        return "the border of the area"
    solids = _solids_in(course)
    low, high = corners.min(axis=0), corners.max(axis=0)
    near = ((solids.low < high) & (solids.high > low)).all(axis=1)
    for number in np.flatnonzero(near):
        loop = solids.loops[number]
        if place.crosses(loop).any() or is_inside(middle, loop)[0]:
            return solids.names[number]
    return ""
