"""What it costs to back a trailer into its slot, from every state from which that is possible.

Over the length of a trailer an angle of a cell is a metre at its end, so cells do not say whether
it gets in between others. Its controllers do: they are driven from the middle of every cell.
"""

import math

import numpy as np

from race_agents.planning.rig_moves import DOCKED, way_in
from race_server.core.free_space.goal_cells import cell_pose
from race_server.core.free_space.obstacles import Obstacles
from race_server.core.free_space.rig import Rig, Towed
from race_server.core.free_space.state_costs import Ends
from race_server.core.free_space.states import (
    BACK,
    BLOCKED,
    TURNS,
    UNKNOWN,
    Costs,
    StateCosts,
    angle_of,
)
from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.jit import large_kernel
from race_server.core.state import Floats

MOST_STEPS = 1024


def backing_in(obstacles: Obstacles, rig: Rig, goal: Pose) -> Ends:
    """Return the costs of states that end in the slot. goal: of the trailer's axle."""

    def ends(found: StateCosts) -> Costs:
        costs = np.full_like(found.costs, UNKNOWN)
        _fill(obstacles, rig, goal, found, costs, np.zeros((MOST_STEPS, 3)))
        return costs

    return ends


@large_kernel
def _fill(
    obstacles: Obstacles, rig: Rig, goal: Pose, found: StateCosts, costs: Costs, rows: Floats
) -> None:
    """Fill the costs of states that drive BACK already."""
    grid, known = found.grid, found.costs
    for number in range(known.shape[1]):
        angle = angle_of(found, number)
        for turn in range(TURNS):
            for row in range(grid.rows):
                for column in range(grid.columns):
                    if known[BACK, number, turn, row, column] == BLOCKED:
                        continue
                    pose = cell_pose(grid, goal, row, column, turn, TURNS)
                    towed = Towed(pose.x, pose.y, pose.heading, angle, math.inf)
                    way = way_in(obstacles, rig, towed, goal, DOCKED, -1.0, rows)
                    if way != math.inf:
                        costs[BACK, number, turn, row, column] = abs(way)
