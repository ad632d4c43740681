"""Where a vehicle can get to in a car park: cells of a grid, and the regions they make."""

import math
from collections import Counter

import numpy as np
from numpy.typing import NDArray

from race_server.core.vehicles import Vehicle
from race_server.scenario.lot.faults import slots_of
from race_server.scenario.lot.footprint import solids_in
from race_server.scenario.lot.site import area_in
from race_server.scenario.track.course import Course, Floats
from race_server.scenario.track.polyline import is_inside
from race_server.scenario.track.walls import clearances_of, fence_of

Bools = NDArray[np.bool_]

# Cells across a vehicle: what is narrower than it by two of them is found.
ACROSS = 16
MOST_CELLS = 2_000_000


class Ways:
    """Where the middle of a vehicle can be in a lot, as cells, and which of them free ways join.

    A vehicle is taken for a disc as wide as it: what it cannot pass so, it cannot pass at all. In
    an area so large that a cell is wider than the vehicle, thin walls part nothing.
    """

    def __init__(self, course: Course, vehicle: Vehicle) -> None:
        """Find the free cells of a car park, walls and obstacles of its file regarded."""
        self.course, self.vehicle = course, vehicle
        area = area_in(course)[:, :2]
        (self._x0, self._y0), (width, height) = area.min(axis=0), np.ptp(area, axis=0)
        wide = vehicle.overall_width
        self._cell = cell = max(wide / ACROSS, math.sqrt(width * height / MOST_CELLS))
        columns, rows = math.ceil(width / cell), math.ceil(height / cell)
        # Painted around each wall, as far as half a vehicle and a bit.
        fence, corner = fence_of(course).segments, (float(self._x0), float(self._y0))
        clear = clearances_of(fence, corner, cell, columns, rows, ACROSS).reshape(rows, columns)
        # From the nearest corner of a cell to its middle; half a cell more, which may lie beside.
        clear += (math.sqrt(0.5) + 0.5) * cell
        is_free = clear >= 0.5 * wide
        is_deep = clear > 2.0 * (math.sqrt(0.5) + 0.5) * cell
        for loop in solids_in(course):
            self._fill(is_free, is_deep, loop)
        # The last cells may reach out of the area.
        is_free[math.floor(height / cell + 0.5) :] = False
        is_free[:, math.floor(width / cell + 0.5) :] = False
        # With one more cell on each side. Which region a free cell belongs to is found when asked.
        self._free = np.pad(is_free, 1)
        self._region = np.zeros(self._free.shape, np.int32)
        self._regions = 0
        # A coarse cell may be free though a wall leads through it. One wider than the vehicle tells
        # nothing of gaps that it passes.
        walls = fence if wide / ACROSS < cell <= wide else fence[:0]
        self._barred = [self._crossed(walls, axis).ravel() for axis in (0, 1)]

    def _crossed(self, walls: Floats, axis: int) -> Bools:
        """Return from which cells the step to the next one, middle to middle, crosses a wall.

        walls: (P, 4) [m]; axis: 0 for steps along x, 1 along y.
        """
        crossed = np.zeros_like(self._free)
        along_count, lines_count = crossed.shape[1 - axis], crossed.shape[axis]
        # In cells, with the one more on each side; middles are whole numbers.
        ends = (walls.reshape(-1, 2, 2) - (self._x0, self._y0)) / self._cell + 0.5
        for start, end in ends:
            (a, b), (first, last) = (start[1 - axis], end[1 - axis]), (start[axis], end[axis])
            low, high = max(math.ceil(min(a, b)), 0), min(math.floor(max(a, b)), lines_count - 1)
            if a == b or low > high:
                continue
            lines = np.arange(low, high + 1)
            cells = np.floor(first + (lines - a) / (b - a) * (last - first)).astype(int)
            is_in = (cells >= 0) & (cells < along_count)
            places = (lines[is_in], cells[is_in])
            crossed[places if axis == 0 else places[::-1]] = True
        return crossed

    def _fill(self, is_free: Bools, is_deep: Bools, loop: Floats) -> None:
        """Take what lies deep inside a loop of sides out of the free cells."""
        corner, count = np.array([self._x0, self._y0]), is_free.shape[::-1]
        low, high = ((part(loop[:, :2], axis=0) - corner) / self._cell for part in (np.min, np.max))
        first = np.clip(np.floor(low).astype(int), 0, count)
        last = np.clip(np.ceil(high).astype(int), 0, count)
        x, y = (corner[n] + (np.arange(first[n], last[n]) + 0.5) * self._cell for n in (0, 1))
        places = np.stack(np.meshgrid(x, y), axis=-1)
        inside = is_inside(places.reshape(-1, 2), loop).reshape(places.shape[:2])
        part = slice(first[1], last[1]), slice(first[0], last[0])
        is_free[part] &= ~(inside & is_deep[part])

    def regions(self, x: tuple[float, float], y: tuple[float, float]) -> set[int]:
        """Return the numbers of all regions with free cells in a rectangle, or next to it.

        x, y: its sides [m]. Ways join two places if they have a region in common.
        """
        rows, columns = self._free.shape
        spans = []
        for (low, high), first, count in ((y, self._y0, rows), (x, self._x0, columns)):
            a, b = (math.floor((place - first) / self._cell) + 1 for place in (low, high))
            spans.append(slice(min(max(a - 1, 0), count), max(b + 2, 0)))
        part = spans[0], spans[1]
        free, region = self._free[part], self._region[part]
        while len(cells := np.argwhere(free & (region == 0))):
            row, column = cells[0].tolist()
            self._flood((spans[0].start + row) * columns + spans[1].start + column)
        return set(np.unique(region[free]).tolist())

    def _flood(self, first: int) -> None:
        """Give a number to all free cells that a way leads to from one of them."""
        self._regions += 1
        free, region = self._free.ravel(), self._region.ravel()
        front = np.array([first])
        region[front] = self._regions
        columns = self._free.shape[1]
        steps, (east, north) = np.array([1, -1, columns, -columns]), self._barred
        while len(front):
            is_barred = [east[front], east[front - 1], north[front], north[front - columns]]
            beside = (front[:, None] + steps)[~np.stack(is_barred, axis=1)]
            front = np.unique(beside[free[beside] & (region[beside] == 0)])
            region[front] = self._regions


def cut_off(ways: Ways) -> list[str]:
    """Return a sentence for each zone and slot that no free way joins."""
    course, vehicle = ways.course, ways.vehicle
    assert course.lot is not None
    zones, slots = course.lot.zones, slots_of(course)
    found = []
    wide = f"{vehicle.name}, {vehicle.overall_width:.2f} m wide"
    places = [ways.regions((slot.x, slot.x), (slot.y, slot.y)) for slot in slots]
    begins = set[int]()
    if course.lot.from_slots:  # each slot but its own is a start
        shared = Counter(region for place in places for region in place)
        begins = {region for region, count in shared.items() if count > 1}
    where = {
        zone: f"zone x {zone.x[0]:g} to {zone.x[1]:g}, y {zone.y[0]:g} to {zone.y[1]:g} m"
        for zone in zones
    }
    for zone in zones:
        if zone.role == "start" and not course.lot.from_slots:
            begins |= (there := ways.regions(zone.x, zone.y))
            if not there:
                place = f"start {where[zone]} lies in a wall: it has no place for {wide}"
                found.append(f"{place}; move it")
    found += [
        f"no free way leads from a start to the goal {where[zone]} for {wide}"
        for zone in zones
        if zone.role == "goal" and begins.isdisjoint(ways.regions(zone.x, zone.y))
    ]
    for number, slot in enumerate(slots):
        if begins.isdisjoint(places[number]):
            found.append(
                f"no free way leads from a start to slot {number} at ({slot.x:.2f}, {slot.y:.2f}) "
                f"m for {wide}"
            )
    return found
