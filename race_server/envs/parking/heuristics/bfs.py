"""Breadth-first search over cells of a square metre."""

from race_server.core.kernels.distance_field import cell_at
from race_server.core.kernels.jit import kernel
from race_server.envs.parking.heuristics.aim import Aim
from race_server.envs.parking.heuristics.heuristic import SIDES, Chart, Heuristic

HEURISTIC = Heuristic("bfs", "walls, in whole metres from side to side of cells", SIDES)


@kernel
def way(aim: Aim, chart: Chart) -> float:
    """Return the way [m] of the cell in which the middle of the judged box is."""
    row, column = cell_at(chart.grid, aim.middle.x, aim.middle.y)
    return float(chart.ways[row, column])
