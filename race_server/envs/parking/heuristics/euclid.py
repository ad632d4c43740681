"""Straight to the slot."""

import math

from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.jit import kernel
from race_server.envs.parking.heuristics.aim import Aim
from race_server.envs.parking.heuristics.heuristic import Chart, Heuristic

HEURISTIC = Heuristic("euclid", "the straight distance alone")


@kernel
def straight_way(middle: Pose, goal: Pose) -> float:
    """Return the distance [m] between two places."""
    dx, dy = middle.x - goal.x, middle.y - goal.y
    return math.sqrt(dx * dx + dy * dy)


@kernel
def way(aim: Aim, chart: Chart) -> float:
    """Return the distance [m] between the middle of the judged box and its place."""
    return straight_way(aim.middle, aim.goal_middle)
