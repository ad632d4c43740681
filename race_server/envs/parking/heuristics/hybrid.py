"""The usual heuristic of a hybrid A*: the greater one of two lower bounds."""

from race_server.core.kernels.jit import kernel
from race_server.envs.parking.heuristics import grid, reeds_shepp
from race_server.envs.parking.heuristics.aim import Aim
from race_server.envs.parking.heuristics.heuristic import CORNERS, Chart, Heuristic

HEURISTIC = Heuristic("hybrid", "what grid and reeds-shepp know, each alone", CORNERS)

_grid_way, _path_way = grid.way, reeds_shepp.way


@kernel
def way(aim: Aim, chart: Chart) -> float:
    """Return the greater one of the ways [m] of `grid` and `reeds-shepp`."""
    return max(_grid_way(aim, chart), _path_way(aim, chart))
