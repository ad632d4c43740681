"""A pose half-way between two slots, at which two searches can meet in the open."""

import math

from race_server.core.free_space.obstacles import Obstacles
from race_server.core.kernels.distance_field import cell_at
from race_server.core.kernels.geometry import Pose
from race_server.core.state import Floats

# The part of the way, as shares of it, where they may meet.
FIRST, LAST = 0.3, 0.7
# Cells on both sides that give the direction of the way.
SPAN = 4


def cells_down(field: Floats, cell: tuple[int, int]) -> list[tuple[int, int]]:
    """Return the cells from one down to a lowest one, each the lowest of eight around the last."""
    cells = [cell]
    while True:
        row, column = cells[-1]
        around = [
            (i, j)
            for i in range(max(row - 1, 0), min(row + 2, field.shape[0]))
            for j in range(max(column - 1, 0), min(column + 2, field.shape[1]))
        ]
        lowest = min(around, key=lambda cell: field[cell])
        if field[lowest] >= field[row, column]:
            return cells
        cells.append(lowest)


def halfway_poses(obstacles: Obstacles, distances: Floats, start: Pose) -> list[Pose]:
    """Return two poses on the way from a start to the goal of a field, facing along it and back.

    The shortest way follows walls: from where it is widest, of several such places from the most
    central one, they are moved away from the walls. distances: (rows, columns) [m]. None if the way
    is too short.
    """
    grid = obstacles.grid
    cells = cells_down(distances, cell_at(grid, start.x, start.y))
    count = len(cells)
    inner = range(max(int(FIRST * count), SPAN), min(int(LAST * count), count - 1 - SPAN) + 1)
    if not inner:
        return []
    best = max(inner, key=lambda k: (obstacles.clear[cells[k]], -abs(k - 0.5 * count)))
    (row0, column0), (row1, column1) = cells[best - SPAN], cells[best + SPAN]
    heading = math.atan2(row1 - row0, column1 - column0)
    row, column = cells_down(-obstacles.clear, cells[best])[-1]
    x, y = grid.x0 + (column + 0.5) * grid.cell, grid.y0 + (row + 0.5) * grid.cell
    return [Pose(x, y, heading), Pose(x, y, heading + math.pi)]
