"""Where a vehicle can get to in a car park: cells of a grid, flooded from the start zones."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from race_server.core.vehicles import Vehicle
from race_server.scenario.lot.faults import slots_of
from race_server.scenario.lot.site import area_in
from race_server.scenario.track.course import Course
from race_server.scenario.track.walls import clearances_of, fence_of

# Cells across a vehicle: what is narrower than it by two of them is found.
ACROSS = 16
MOST_CELLS = 2_000_000


@dataclass(frozen=True, eq=False)
class Ways:
    """The cells of a lot that the middle of a vehicle can be in, and those that it can get to.

    A vehicle is taken for a disc as wide as it: what it cannot pass so, it cannot pass at all.
    """

    x0: float  # [m] of the first cell's corner
    y0: float  # [m]
    cell: float  # [m]
    free: NDArray[np.bool_]  # (rows, columns)
    reached: NDArray[np.bool_]  # (rows, columns)

    def near(self, x: tuple[float, float], y: tuple[float, float]) -> tuple[slice, slice]:
        """Return the cells of a rectangle, and one more on each side."""
        rows, columns = self.free.shape
        spans = []
        for (low, high), first, count in ((y, self.y0, rows), (x, self.x0, columns)):
            a, b = (math.floor((place - first) / self.cell) for place in (low, high))
            spans.append(slice(max(a - 1, 0), min(b + 2, count)))
        return spans[0], spans[1]


def ways_in(course: Course, vehicle: Vehicle) -> Ways:
    """Return where a vehicle can get to from the start zones of a car park."""
    assert course.lot is not None
    area = area_in(course)[:, :2]
    (x0, y0), (width, height) = area.min(axis=0), np.ptp(area, axis=0)
    wide = vehicle.overall_width
    cell = max(wide / ACROSS, math.sqrt(width * height / MOST_CELLS))
    columns, rows = math.ceil(width / cell), math.ceil(height / cell)
    # Painted around each wall, as far as half a vehicle and a bit.
    clear = clearances_of(fence_of(course).segments, (x0, y0), cell, columns, rows, ACROSS)
    # From the nearest corner of a cell to its middle; half a cell more, which may lie beside it.
    free = clear.reshape(rows, columns) + (math.sqrt(0.5) + 0.5) * cell >= 0.5 * wide
    ways = Ways(float(x0), float(y0), cell, free, np.zeros_like(free))
    for zone in course.lot.zones:
        if zone.role == "start":
            _flood(ways, zone.x, zone.y)
    if course.lot.from_slots:
        for slot in slots_of(course):
            _flood(ways, (slot.x, slot.x), (slot.y, slot.y))
    return ways


def _flood(ways: Ways, x: tuple[float, float], y: tuple[float, float]) -> None:
    """Mark all free cells that a way leads to from a rectangle. x, y: its sides [m]."""
    rows, columns = ways.free.shape
    padded = np.zeros((rows + 2, columns + 2), np.bool_)
    padded[1:-1, 1:-1] = ways.free
    begin = np.zeros_like(padded)
    part = ways.near(x, y)
    # What leads from cells that are marked is marked, too.
    begin[1:-1, 1:-1][part] = ways.free[part] & ~ways.reached[part]
    open_, reached = padded.ravel(), begin.ravel()
    front = np.flatnonzero(reached)
    steps = np.array([1, -1, columns + 2, -columns - 2])
    while len(front):
        beside = (front[:, None] + steps).ravel()
        front = np.unique(beside[open_[beside] & ~reached[beside]])
        reached[front] = True
    ways.reached[:] |= reached.reshape(padded.shape)[1:-1, 1:-1]


def cut_off(course: Course, vehicle: Vehicle) -> list[str]:
    """Return a sentence for each zone and slot that no free way joins."""
    assert course.lot is not None
    ways = ways_in(course, vehicle)
    found = []
    wide = f"{vehicle.name}, {vehicle.overall_width:.2f} m wide"
    for zone in course.lot.zones:
        where = f"zone x {zone.x[0]:g} to {zone.x[1]:g}, y {zone.y[0]:g} to {zone.y[1]:g} m"
        part = ways.near(zone.x, zone.y)
        if zone.role == "start" and not ways.free[part].any():
            found.append(f"start {where} lies in a wall: it has no place for {wide}; move it")
        if zone.role == "goal" and not ways.reached[part].any():
            found.append(f"no free way leads from a start to the goal {where} for {wide}")
    for number, slot in enumerate(slots_of(course)):
        if not ways.reached[ways.near((slot.x, slot.x), (slot.y, slot.y))].any():
            found.append(
                f"no free way leads from a start to slot {number} at ({slot.x:.2f}, {slot.y:.2f}) "
                f"m for {wide}"
            )
    return found
