"""Grids that tell the way around walls: how far every place is from a wall, and from a goal.

The way to a goal leads from cell to neighbouring cell, and over no cell that is too near to a wall.
It is a lower bound of what a car must drive where only cells are left out on which the car cannot
stand, and the usual heuristic of a search among obstacles.
"""

import math
from typing import NamedTuple

from race_server.core.kernels.boxes import Box
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.state import Floats, Ints

DIAGONAL = math.sqrt(2.0)  # way [cells] to a neighbour over a corner
# Instead of a distance: over this cell none drives, so that no distance is less.
CLOSED = -1.0
# A cell in a queue: its row above these bits, its column in them.
ROW_BITS, COLUMN_MASK = 32, (1 << 32) - 1


class Grid(NamedTuple):
    """Square cells over a rectangle; a cell is known by row and column."""

    x0: float  # [m] lowest corner
    y0: float  # [m]
    cell: float  # [m] side of a cell
    columns: int
    rows: int


@kernel
def cell_at(grid: Grid, x: float, y: float) -> tuple[int, int]:
    """Return row and column of the cell at a place [m], or of the one next to it outside."""
    column = min(max(math.floor((x - grid.x0) / grid.cell), 0), grid.columns - 1)
    row = min(max(math.floor((y - grid.y0) / grid.cell), 0), grid.rows - 1)
    return row, column


@kernel
def _lower(grid: Grid, clear: Floats, x: float, y: float, box: Box) -> None:
    """Lower the clearance at cells whose middle lies near to a box.

    clear: (rows, columns) [m]; x, y: the box reaches so far from its middle along the axes [m].
    """
    first_row, first_column = cell_at(grid, box.x - x, box.y - y)
    last_row, last_column = cell_at(grid, box.x + x, box.y + y)
    for row in range(first_row, last_row + 1):
        dy = grid.y0 + (row + 0.5) * grid.cell - box.y
        for column in range(first_column, last_column + 1):
            dx = grid.x0 + (column + 0.5) * grid.cell - box.x
            ahead = max(abs(dx * box.cos + dy * box.sin) - box.half_length, 0.0)
            aside = max(abs(dy * box.cos - dx * box.sin) - box.half_width, 0.0)
            distance = math.sqrt(ahead * ahead + aside * aside)
            clear[row, column] = min(clear[row, column], distance)


@large_kernel
def clear_of_box(grid: Grid, clear: Floats, box: Box, most: float) -> None:
    """Lower the clearance of cells to the distance [m] of their middle from a box, 0 inside.

    clear: (rows, columns) [m], of which none is more than `most`.
    """
    cos, sin = abs(box.cos), abs(box.sin)
    x = box.half_length * cos + box.half_width * sin + most
    y = box.half_length * sin + box.half_width * cos + most
    _lower(grid, clear, x, y, box)


@large_kernel
def clear_of_walls(grid: Grid, clear: Floats, walls: Floats, most: float) -> None:
    """Lower the clearance of cells to the distance [m] of their middle from walls.

    clear: (rows, columns) [m], of which none is more than `most`; walls: (P, 4) x0, y0, x1, y1 [m].
    """
    for wall in range(len(walls)):
        dx, dy = walls[wall, 2] - walls[wall, 0], walls[wall, 3] - walls[wall, 1]
        length = math.sqrt(dx * dx + dy * dy)
        cos, sin = (dx / length, dy / length) if length > 0.0 else (1.0, 0.0)
        # A wall is a box without width.
        x, y = walls[wall, 0] + 0.5 * dx, walls[wall, 1] + 0.5 * dy
        box = Box(x, y, cos, sin, 0.5 * length, 0.0, 0)
        _lower(grid, clear, 0.5 * abs(dx) + most, 0.5 * abs(dy) + most, box)


@kernel
def _reach(
    grid: Grid, distances: Floats, row: int, column: int, far: float, queue: Ints, end: int
) -> int:
    """Put a cell into a queue if it is nearer than it was; return the end of the queue."""
    if 0 <= row < grid.rows and 0 <= column < grid.columns and far < distances[row, column]:
        distances[row, column] = far
        queue[end] = (row << ROW_BITS) + column
        return end + 1
    return end


@kernel
def _reach_over_corners(
    grid: Grid, distances: Floats, clear: Floats, least: float, cell: int, queue: Ints, end: int
) -> int:
    """Do so with the cells over the corners of a cell, unless two cells close the corner."""
    row, column = cell >> ROW_BITS, cell & COLUMN_MASK
    far = distances[row, column] + grid.cell * DIAGONAL
    for i in (row - 1, row + 1):
        for j in (column - 1, column + 1):
            if 0 <= i < grid.rows and 0 <= j < grid.columns and far < distances[i, j]:
                if clear[row, j] >= least or clear[i, column] >= least:
                    end = _reach(grid, distances, i, j, far, queue, end)
    return end


@large_kernel
def fill_distances(
    grid: Grid,
    clear: Floats,
    least: float,
    goal: tuple[float, float],
    has_diagonals: bool,
    distances: Floats,
    queues: Ints,
) -> None:
    """Write how far [m] each cell's middle is from the cell of a goal; infinity if cut off.

    clear: (rows, columns) [m]; cells with less than `least` [m] are not driven over, except for the
    goal's; goal: x, y [m]; has_diagonals: whether a step may lead over a corner, which two cells
    that are not driven over close; distances: (rows, columns) [m]; queues: (2, rows · columns),
    work space.

    Dijkstra's algorithm without a heap: cells are taken in the order of their distances, so those
    reached by straight steps are found in order, and so are those reached over a corner.
    """
    for row in range(grid.rows):
        for column in range(grid.columns):
            distances[row, column] = CLOSED if clear[row, column] < least else math.inf
    row, column = cell_at(grid, goal[0], goal[1])
    distances[row, column] = 0.0
    queues[0, 0] = (row << ROW_BITS) + column
    straight, straights, diagonal, diagonals = 0, 1, 0, 0
    while straight < straights or diagonal < diagonals:
        take_straight = diagonal == diagonals
        if straight < straights and diagonal < diagonals:
            a, b = queues[0, straight], queues[1, diagonal]
            value = distances[a >> ROW_BITS, a & COLUMN_MASK]
            take_straight = value < distances[b >> ROW_BITS, b & COLUMN_MASK]
        cell = queues[0, straight] if take_straight else queues[1, diagonal]
        straight, diagonal = straight + int(take_straight), diagonal + int(not take_straight)
        row, column = cell >> ROW_BITS, cell & COLUMN_MASK
        value = distances[row, column]
        for way in (-1, 1):
            far = value + grid.cell
            straights = _reach(grid, distances, row + way, column, far, queues[0], straights)
            straights = _reach(grid, distances, row, column + way, far, queues[0], straights)
        if has_diagonals:
            diagonals = _reach_over_corners(
                grid, distances, clear, least, cell, queues[1], diagonals
            )
    for row in range(grid.rows):
        for column in range(grid.columns):
            if distances[row, column] == CLOSED:
                distances[row, column] = math.inf


@kernel
def _over_neighbours(
    grid: Grid, distances: Floats, row: int, column: int, step: int, has_diagonals: bool
) -> float:
    """Return the least distance [m] to a cell over its neighbours on one side.

    distances: (rows, columns) [m], their signs do not matter; step: -1 for the neighbours before
    the cell, row by row, 1 for those behind it.
    """
    i, j, cell = row + step, column + step, grid.cell
    least = abs(distances[row, j]) + cell if 0 <= j < grid.columns else math.inf
    if 0 <= i < grid.rows:
        least = min(least, abs(distances[i, column]) + cell)
        for beside in (column - 1, column + 1):
            if has_diagonals and 0 <= beside < grid.columns:
                least = min(least, abs(distances[i, beside]) + cell * DIAGONAL)
    return least


@large_kernel
def fill_cut_off(grid: Grid, distances: Floats, has_diagonals: bool) -> None:
    """Continue distances from cell to cell over those that are cut off, until none is infinite.

    distances: (rows, columns) [m], of which one at least is finite; has_diagonals: whether a step
    may lead over a corner. Sweeps from either end, as distance transforms of pictures make them,
    until nothing changes. Until then what is continued is below zero.
    """
    rows, columns, has_changed = grid.rows, grid.columns, True
    while has_changed:
        has_changed = False
        for step in (-1, 1):
            for r in range(rows):
                row = r if step < 0 else rows - 1 - r
                for c in range(columns):
                    column = c if step < 0 else columns - 1 - c
                    value = distances[row, column]
                    if 0.0 <= value < math.inf:
                        continue
                    near = _over_neighbours(grid, distances, row, column, step, has_diagonals)
                    if near < abs(value):
                        distances[row, column] = -near
                        has_changed = True
    for row in range(rows):
        for column in range(columns):
            distances[row, column] = abs(distances[row, column])


@kernel
def distance_at(grid: Grid, distances: Floats, x: float, y: float) -> float:
    """Return the distance [m] at a place [m], bilinear between the middles of four cells.

    distances: (rows, columns) [m]. Cells that are cut off do not count; infinity if all four are.
    """
    u = min(max((x - grid.x0) / grid.cell - 0.5, 0.0), grid.columns - 1.0)
    v = min(max((y - grid.y0) / grid.cell - 0.5, 0.0), grid.rows - 1.0)
    column, row = int(u), int(v)
    right, above = u - column, v - row
    total, weights = 0.0, 0.0
    for i in range(2):
        for j in range(2):
            weight = (above if i else 1.0 - above) * (right if j else 1.0 - right)
            if weight > 0.0 and distances[row + i, column + j] < math.inf:
                total += weight * distances[row + i, column + j]
                weights += weight
    return total / weights if weights > 0.0 else math.inf
