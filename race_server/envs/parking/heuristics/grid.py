"""Dijkstra's algorithm over cells and their corners."""

from race_server.core.kernels.distance_field import distance_at
from race_server.core.kernels.jit import kernel
from race_server.envs.parking.heuristics.aim import Aim
from race_server.envs.parking.heuristics.heuristic import CORNERS, Chart, Heuristic

HEURISTIC = Heuristic("grid", "walls, and how wide the vehicle is", CORNERS)


@kernel
def way(aim: Aim, chart: Chart) -> float:
    """Return the way [m] of the middle of the judged box, bilinear between the middles of cells."""
    return distance_at(chart.grid, chart.ways, aim.middle.x, aim.middle.y)
