"""The cost of the way that the trailer has to be driven, with both bodies past all obstacles.

Far from the slot that of the cells of an atlas, which also counts changes of direction. Near it the
cells are too coarse, and the shortest path of the trailer as if it were a car is longer.
"""

from race_server.core.kernels.jit import kernel
from race_server.envs.parking.heuristics import trailer_car
from race_server.envs.parking.heuristics.aim import Aim
from race_server.envs.parking.heuristics.atlas import cost_from
from race_server.envs.parking.heuristics.heuristic import Chart, Heuristic

HEURISTIC = Heuristic(
    "cost-to-go",
    "walls, the other slots, the length of both bodies, and what a change of direction costs",
    has_trailer=True,
    has_atlas=True,
)

_path_way = trailer_car.way


@kernel
def way(aim: Aim, chart: Chart) -> float:
    """Return the greater one of the costs [m] of the atlas and of the way of `trailer-car`."""
    cost = cost_from(chart.costs, chart.frame, aim.goal_last, aim.last)
    return max(cost, _path_way(aim, chart))
