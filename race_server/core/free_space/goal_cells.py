"""Cells of place and heading in the frame of a goal, which is the middle of one of them."""

import math

import numpy as np

from race_server.core.kernels.distance_field import Grid
from race_server.core.kernels.geometry import TURN, Pose, cos_sin
from race_server.core.kernels.jit import kernel


def goal_cells(
    ground: Grid, goal: Pose, cell: float, *, reach: float = math.inf, most: float = math.inf
) -> Grid:
    """Return cells over the ground.

    cell: side [m], at least; reach: most that they extend from the goal along each axis [m]; most:
    cells, for which they are made larger.
    """
    x = ground.x0 + np.array([0.0, ground.columns, 0.0, ground.columns]) * ground.cell
    y = ground.y0 + np.array([0.0, 0.0, ground.rows, ground.rows]) * ground.cell
    cos, sin = math.cos(goal.heading), math.sin(goal.heading)
    along = np.clip((x - goal.x) * cos + (y - goal.y) * sin, -reach, reach)
    across = np.clip((y - goal.y) * cos - (x - goal.x) * sin, -reach, reach)
    cell = max(cell, 1.05 * math.sqrt(float(np.ptp(along) * np.ptp(across)) / most))
    before, beside = (math.ceil(-side.min() / cell) for side in (along, across))
    columns = before + math.ceil(along.max() / cell) + 1
    rows = beside + math.ceil(across.max() / cell) + 1
    return Grid(-(before + 0.5) * cell, -(beside + 0.5) * cell, cell, columns, rows)


@kernel
def cell_pose(grid: Grid, goal: Pose, row: int, column: int, turn: int, turns: int) -> Pose:
    """Return the middle of a cell, on the ground. turn: number of its heading among `turns`."""
    cos, sin = cos_sin(goal.heading)
    across = grid.y0 + (row + 0.5) * grid.cell
    along = grid.x0 + (column + 0.5) * grid.cell
    x = goal.x + along * cos - across * sin
    y = goal.y + along * sin + across * cos
    return Pose(x, y, goal.heading + turn * TURN / turns)
