"""The ground between a start and a goal: obstacles on a grid, and the distance from each cell."""

import math

import numpy as np

from race_server.core.free_space.obstacles import Obstacles, survey
from race_server.core.kernels.distance_field import Grid, fill_distances
from race_server.core.kernels.geometry import Pose
from race_server.core.state import Floats

# Side of the grid's cells [m], and most of them: a larger area has larger ones.
CELL, MOST_CELLS = 0.25, 250_000
NO_BOXES = np.zeros((0, 6))


class Ground:
    """Room for one grid, made once."""

    def __init__(self) -> None:
        """Make it."""
        self._clear, self._distances = np.zeros(MOST_CELLS), np.zeros(MOST_CELLS)
        self._queues = np.zeros((2, MOST_CELLS), np.int64)

    def obstacles(
        self, start: Pose, goal: Pose, walls: Floats, boxes: Floats, *, reach: float, near: float
    ) -> Obstacles:
        """Return the obstacles around start and goal, with a grid over them.

        walls: (P, 4) x0, y0, x1, y1 [m]; boxes: (B, 6) x, y [m] of the middle, cosine and sine of
        the heading, half length, half width [m]; reach: how far around both the grid goes [m];
        near: beyond this distance [m] it does not matter how far an obstacle is.
        """
        low = np.minimum(start[:2], goal[:2]) - reach
        high = np.maximum(start[:2], goal[:2]) + reach
        width, height = (float(side) for side in high - low)
        # One cell more each way, because both counts are rounded up.
        cell = max(CELL, math.sqrt(width * height / MOST_CELLS) * 1.01)
        columns, rows = math.ceil(width / cell), math.ceil(height / cell)
        ends = walls.reshape(-1, 2, 2)
        by_walls = ((ends.max(axis=1) >= low) & (ends.min(axis=1) <= high)).all(axis=1)
        around = np.hypot(boxes[:, 4], boxes[:, 5])[:, None]
        by = ((boxes[:, :2] + around >= low) & (boxes[:, :2] - around <= high)).all(axis=1)
        obstacles = Obstacles(
            Grid(float(low[0]), float(low[1]), cell, columns, rows),
            self._clear[: rows * columns].reshape(rows, columns),
            np.ascontiguousarray(walls[by_walls], np.float64),
            np.ascontiguousarray(boxes[by], np.float64),
        )
        survey(obstacles, near + cell)
        return obstacles

    def distances_to(self, goal: Pose, obstacles: Obstacles, least: float) -> Floats:
        """Return the distance [m] from each cell to a goal, over cells with room: (rows, columns).

        least: cells nearer than this [m] to an obstacle are not driven over.
        """
        grid = obstacles.grid
        distances = self._distances[: grid.rows * grid.columns].reshape(grid.rows, grid.columns)
        place = (goal.x, goal.y)
        fill_distances(grid, obstacles.clear, least, place, True, distances, self._queues)
        return distances


def farthest_wall(start: Pose, goal: Pose, walls: Floats) -> float:
    """Return how far [m] walls lead beyond start and goal, along x or y."""
    ends, both = walls.reshape(-1, 2), np.array([start[:2], goal[:2]])
    beyond = np.concatenate([both.min(axis=0) - ends, ends - both.max(axis=0)])
    return float(beyond.max(initial=0.0))
