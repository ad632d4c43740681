"""Straight to the slot."""

import math

from race_server.core.kernels.jit import kernel
from race_server.envs.parking.heuristics.aim import Aim
from race_server.envs.parking.heuristics.heuristic import Chart, Heuristic

HEURISTIC = Heuristic("euclid", "the straight distance alone")


@kernel
def way(aim: Aim, chart: Chart) -> float:
    """Return the distance [m] between the middle of the judged box and its place."""
    dx, dy = aim.middle.x - aim.goal_middle.x, aim.middle.y - aim.goal_middle.y
    return math.sqrt(dx * dx + dy * dy)
