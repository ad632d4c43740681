"""The shortest path of a car that drives both ways."""

from race_server.core.kernels.jit import kernel
from race_server.core.kernels.reeds_shepp import shortest_length
from race_server.envs.parking.heuristics.aim import Aim
from race_server.envs.parking.heuristics.heuristic import Chart, Heuristic

HEURISTIC = Heuristic("reeds-shepp", "heading, least radius and reversing, but no walls")


@kernel
def way(aim: Aim, chart: Chart) -> float:
    """Return the length [m] of the rear axle's shortest path at its least radius."""
    return shortest_length(aim.axle, aim.goal_axle, aim.radius)
