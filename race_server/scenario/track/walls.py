"""Walls packed into flat arrays for the kernels, with a grid over them."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from race_server.core import codes
from race_server.core.state import GROUP, SITE, Records, Walls
from race_server.errors import TrackError
from race_server.scenario.track.course import Course, Floats, Obstacle
from race_server.scenario.track.polyline import (
    area_of,
    corners_of_box,
    is_inside,
    loops_of,
    segments_of,
)

# A cell is about this share of the free width: small enough that few walls share one.
CELL_SHARE = 0.18
# A cell of a car park [m]: about a third of a vehicle.
LOT_CELL = 1.0
# A wall is listed in every cell that comes this close to it [m]; see `core/kernels/rays.py`.
MARGIN = 1e-6
# Longest side of a free box, in cells, that is worth knowing.
MOST_FREE = 60
# Clearance from walls, in cells, beyond which it does not matter how large it is.
CLEAR_CELLS = 6
# Cells of a grid, and those near to walls, each counted for each of its walls.
MOST_CELLS, MOST_NEAR = 1 << 22, 1 << 25
# Grids that are kept, as the runs of a trial and the races of an exam pack the same walls again and
# again [bytes]: one takes 0.2 MB on a kart track of 400 m, and a hundred where it is as large as
# can be.
KEPT = 1 << 26
# Walls in one circle that a sensor looks at as a whole.
GROUP_WALLS = 12


class Fence(NamedTuple):
    """The walls of one site."""

    segments: Floats  # (P, 4) x0, y0, x1, y1 [m], the drivable side on the left
    kinds: NDArray[np.uint8]  # (P,) Hit
    cell: float  # [m] side of the grid's cells


class _Grid(NamedTuple):
    """The grid over the walls of one site."""

    origin: tuple[float, float]  # x, y [m]
    columns: int
    rows: int
    first: NDArray[np.int64]  # (cells + 1,) first entry of each cell
    entries: NDArray[np.int64]  # (E,) walls, cell after cell
    clear: NDArray[np.float32]  # (cells,) [m]
    free: NDArray[np.uint8]  # (cells, 8, 2)


_kept: dict[tuple[bytes, float], _Grid] = {}  # from the least recently asked for on


def pack_walls(fences: Sequence[Fence]) -> Walls:
    """Return the walls of all sites behind one another; site s is `sites[s]`."""
    sites = np.zeros(len(fences), SITE)
    groups, firsts, members, clears, frees = [], [], [], [], []
    walls = cells = circles = listed = 0
    for site, (segments, _, cell) in zip(sites, fences, strict=True):
        grid = _grid_of(segments, cell)
        origin, columns, rows, first, entries = grid[:5]
        groups.append(_groups_of(segments, walls))
        site.cell, site.columns, site.rows = cell, columns, rows
        site.x0, site.y0 = origin
        site.wall_start, site.wall_count = walls, len(segments)
        site.group_start, site.group_count = circles, len(groups[-1])
        site.cell_start = cells
        firsts.append(first[:-1] + listed)
        members.append(entries)
        clears.append(grid.clear)
        frees.append(grid.free)
        walls, cells = walls + len(segments), cells + columns * rows
        circles, listed = circles + len(groups[-1]), listed + len(entries)
    return Walls(
        sites=sites,
        # One order of memory for all sites, or kernels are compiled for each again.
        segments=np.ascontiguousarray(np.concatenate([fence.segments for fence in fences])),
        kinds=np.concatenate([fence.kinds for fence in fences]),
        groups=np.concatenate(groups),
        cell_first=np.concatenate([*firsts, [listed]]).astype(np.int32),
        cell_walls=np.concatenate(members).astype(np.int32),
        cell_clear=np.concatenate(clears),
        cell_free=np.concatenate(frees),
    )


def fence_of(course: Course) -> Fence:
    """Return the borders and obstacles of a course."""
    boxes = [_sides(obstacle) for obstacle in course.obstacles]
    segments = np.concatenate([_facing_the_track(course), *boxes])
    kinds = np.full(len(segments), codes.BORDER, np.uint8)
    kinds[len(course.borders) :] = codes.OBSTACLE
    cell = CELL_SHARE * course.width_mean if len(course.line) else LOT_CELL
    return Fence(segments, kinds, cell)


def _facing_the_track(course: Course) -> Floats:
    """Return the borders, turned so that the drivable side is on the left of each segment."""
    if not len(course.line):
        return course.borders  # of a car park: counter-clockwise already
    inner = course.line[:1, :2]
    turned = []
    for loop in loops_of(course.borders):
        is_around = bool(is_inside(inner, loop)[0])
        counter_clockwise = area_of(loop[:, :2]) > 0.0
        # Inside a loop driven around, the left of a counter-clockwise walk is the track.
        turned.append(loop if is_around == counter_clockwise else loop[::-1][:, [2, 3, 0, 1]])
    return np.concatenate(turned)


def _sides(obstacle: Obstacle) -> Floats:
    corners = corners_of_box(
        obstacle.x, obstacle.y, obstacle.heading, obstacle.length, obstacle.width
    )
    # Clockwise, so that the outside lies on the left of each side.
    return segments_of(corners[::-1])


def _groups_of(segments: Floats, first_wall: int) -> Records:
    """Return circles around runs of walls; a sensor too far from a circle skips its walls."""
    groups = np.zeros(-(-len(segments) // GROUP_WALLS), GROUP)
    for number, group in enumerate(groups):
        first = number * GROUP_WALLS
        points = segments[first : first + GROUP_WALLS].reshape(-1, 2)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        group.x, group.y = middle
        group.radius = float(np.hypot(*(points - middle).T).max())
        group.first = first_wall + first
        group.last = first_wall + min(first + GROUP_WALLS, len(segments))
    return groups


def grid_over(segments: Floats, cell: float) -> tuple[tuple[float, float], int, int]:
    """Return corner [m], columns and rows of a grid that reaches a cell beyond the walls.

    Raises:
        TrackError: it would be too large.
    """
    points = segments.reshape(-1, 2)
    low, high = points.min(axis=0) - cell, points.max(axis=0) + cell
    with np.errstate(over="ignore"):
        counts = np.ceil((high - low) / cell)
        # Cells near to a wall, of all walls: each of them is looked at.
        sides = np.abs(segments[:, 2:] - segments[:, :2]) / cell + 2.0 * CLEAR_CELLS
        cells, near = counts.prod(), sides.prod(axis=1).sum()
    if not (cells <= MOST_CELLS and near <= MOST_NEAR):
        raise TrackError(
            f"a course of {high[0] - low[0]:.3g} m by {high[1] - low[1]:.3g} m with a free width "
            f"of {cell / CELL_SHARE:.3g} m: the grid over its walls has {cells:.3g} cells, of "
            f"{MOST_CELLS} at most, and {near:.3g} entries, of {MOST_NEAR} at most; make it "
            "smaller, or wider"
        )
    return (float(low[0]), float(low[1])), int(counts[0]), int(counts[1])


def _grid_of(walls: Floats, cell: float) -> _Grid:
    """Return the grid over walls (P, 4), the same again where it is still kept."""
    key = (walls.tobytes(), cell)
    grid = _kept.pop(key, None) or _made_grid(walls, cell)
    _kept[key] = grid  # behind those that were asked for before
    while len(_kept) > 1 and sum(map(_bytes_of, list(_kept.values()))) > KEPT:
        oldest, *_ = _kept
        _kept.pop(oldest, None)
    return grid


def _bytes_of(grid: _Grid) -> int:
    return sum(one.nbytes for one in (grid.first, grid.entries, grid.clear, grid.free))


def _made_grid(walls: Floats, cell: float) -> _Grid:
    origin, columns, rows = grid_over(walls, cell)
    first, entries = _list_walls(walls, origin, cell, columns, rows)
    clear = clearances_of(walls, origin, cell, columns, rows)
    return _Grid(origin, columns, rows, first, entries, clear, _free_boxes(first, columns, rows))


def _list_walls(
    segments: Floats, origin: tuple[float, float], cell: float, columns: int, rows: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the first entry of each cell, shape (cells + 1,), and the walls listed in them."""
    found = []
    for number, (x0, y0, x1, y1) in enumerate(segments - np.array([*origin, *origin])):
        low_c, high_c = _span(x0, x1, cell, columns)
        low_r, high_r = _span(y0, y1, cell, rows)
        column, row = np.meshgrid(np.arange(low_c, high_c + 1), np.arange(low_r, high_r + 1))
        # A cell touches the wall's line if its middle is no further than its half-diagonal's
        # projection on the normal; the spans above take care of the ends.
        ex, ey = x1 - x0, y1 - y0
        across = ex * ((row + 0.5) * cell - y0) - ey * ((column + 0.5) * cell - x0)
        reach = 0.5 * cell * (abs(ex) + abs(ey)) + MARGIN * math.hypot(ex, ey)
        near = np.abs(across) <= reach
        cells = (row * columns + column)[near]
        found.append(np.stack([cells, np.full(len(cells), number)]))
    cells, walls = np.concatenate(found, axis=1)
    order = np.argsort(cells, kind="stable")
    first = np.zeros(columns * rows + 1, np.int64)
    first[1:] = np.cumsum(np.bincount(cells, minlength=columns * rows))
    return first, walls[order]


def _span(a: float, b: float, cell: float, count: int, margin: float = MARGIN) -> tuple[int, int]:
    low, high = min(a, b) - margin, max(a, b) + margin
    return max(int(low // cell), 0), min(int(high // cell), count - 1)


def clearances_of(
    segments: Floats,
    origin: tuple[float, float],
    cell: float,
    columns: int,
    rows: int,
    cells: int = CLEAR_CELLS,
) -> NDArray[np.float32]:
    """Return for each cell how far [m] every point of it is from any wall, at least.

    cells: beyond this number of them it does not matter how far.
    """
    most = cells * cell
    clear = np.full((rows, columns), most)
    x, y = (np.arange(columns) + 0.5) * cell, (np.arange(rows) + 0.5) * cell
    for x0, y0, x1, y1 in segments - np.array([*origin, *origin]):
        low_c, high_c = _span(x0, x1, cell, columns, most)
        low_r, high_r = _span(y0, y1, cell, rows, most)
        part = (slice(low_r, high_r + 1), slice(low_c, high_c + 1))
        dx, dy = x[part[1]][None] - x0, y[part[0]][:, None] - y0
        ex, ey = x1 - x0, y1 - y0
        share = np.clip((dx * ex + dy * ey) / max(ex * ex + ey * ey, 1e-12), 0.0, 1.0)
        clear[part] = np.minimum(clear[part], np.hypot(dx - share * ex, dy - share * ey))
    # From the middle of a cell to its corners.
    clear -= math.sqrt(0.5) * cell + MARGIN
    return np.maximum(clear, 0.0).astype(np.float32).ravel()


def _free_boxes(first: NDArray[np.int64], columns: int, rows: int) -> NDArray[np.uint8]:
    """Return the free box that rays of each octant may skip, shape (cells, 8, 2).

    The box has the cell in its corner; its sides [cells] along x and y are 0 where the cell
    holds walls. Octant: bit 0 towards -x, bit 1 towards -y, bit 2 steeper than 45°.
    """
    holds = (np.diff(first) > 0).reshape(rows, columns)
    boxes = np.zeros((rows, columns, 8, 2), np.uint8)
    for octant in range(8):
        flip = (
            slice(None, None, -1 if octant & 2 else 1),
            slice(None, None, -1 if octant & 1 else 1),
        )
        turned = holds[flip].T if octant & 4 else holds[flip]
        long, short = _longest_boxes(turned)
        sides = (short.T, long.T) if octant & 4 else (long, short)
        for axis, side in enumerate(sides):
            boxes[:, :, octant, axis] = side[flip]
    return boxes.reshape(-1, 8, 2)


def _longest_boxes(holds: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return width and height of the best free box towards +x +y for rays flatter than 45°.

    The best is the one that such a ray leaves latest on average over its slopes s from 0 to 1:
    after min(width, height / s).
    """
    runs = np.zeros(holds.shape, np.int64)
    ahead = np.full(len(holds), MOST_FREE)
    for column in range(holds.shape[1] - 1, -1, -1):
        ahead = np.where(holds[:, column], 0, np.minimum(ahead + 1, MOST_FREE))
        runs[:, column] = ahead
    width, best = runs.copy(), np.zeros(holds.shape)
    long, short = np.zeros_like(runs), np.zeros_like(runs)
    for height in range(1, MOST_FREE + 1):
        if height > 1:
            # One row more; beyond the grid there is nothing.
            above = np.full(runs.shape, MOST_FREE)
            above[: max(len(runs) - height + 1, 0)] = runs[height - 1 :]
            width = np.minimum(width, above)
        if not width.any():
            break
        bend = np.minimum(height / np.maximum(width, 1), 1.0)
        score = width * bend - height * np.log(bend)
        better = (score > best) & (width > 0)
        best = np.where(better, score, best)
        long, short = np.where(better, width, long), np.where(better, height, short)
    return long, short
