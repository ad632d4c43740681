"""A car park whose vehicles start nearer to their slots than it asks, or farther from them."""

import math
from dataclasses import replace

import numpy as np

from race_server.core.lots import GOAL, ROLES, START
from race_server.scenario.lot.site import area_in
from race_server.scenario.track.course import Course
from race_server.scenario.track.lot import Lot, Zone


def at_distance(course: Course, distance: tuple[float, float]) -> Course:
    """Return a car park in which vehicles start at `distance` [m] from their slots.

    distance: least and greatest. They start in the rectangle around all goal zones and slots, grown
    by the greatest distance as far as the area reaches, with headings as different as in the start
    zone with the widest spread, or any heading where they would start in slots.
    """
    lot = course.lot
    assert lot is not None
    corners = area_in(course)[:, :2]
    start = _around_slots(lot, distance[1], corners.min(axis=0), corners.max(axis=0))
    others = tuple(zone for zone in lot.zones if ROLES[zone.role] != START)
    nearer = replace(lot, zones=(*others, start), distance=distance, from_slots=False)
    return replace(course, lot=nearer)


def _around_slots(lot: Lot, reach: float, low: np.ndarray, high: np.ndarray) -> Zone:
    """Return a start zone around all slots. reach: [m]; low, high: corners of the area, (2,)."""
    goals = [zone for zone in lot.zones if ROLES[zone.role] == GOAL]
    ends = [np.array((zone.x, zone.y)).T for zone in goals]
    places = np.concatenate([*ends, lot.slots[:, :2]])  # (n, 2)
    first = np.maximum(places.min(axis=0) - reach, low)
    last = np.minimum(places.max(axis=0) + reach, high)
    (x0, y0), (x1, y1) = first.tolist(), last.tolist()
    around = Zone("start", (x0, x1), (y0, y1), spread=math.pi)
    starts = [zone for zone in lot.zones if ROLES[zone.role] == START]
    if not starts:
        return around
    return replace(max(starts, key=lambda zone: zone.spread), x=around.x, y=around.y)
