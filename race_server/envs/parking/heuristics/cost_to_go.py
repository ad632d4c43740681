"""The cost of the way that the last axle has to be driven, with all bodies past all obstacles.

Far from the slot that of the cells of an atlas, which also counts changes of direction. Near it the
cells are too coarse, and the shortest path of a car, or of the trailer as if it were one, is
longer.
"""

from race_server.core.kernels.jit import kernel
from race_server.envs.parking.heuristics import reeds_shepp, trailer_car
from race_server.envs.parking.heuristics.aim import Aim
from race_server.envs.parking.heuristics.atlas import cost_from
from race_server.envs.parking.heuristics.heuristic import Chart, Heuristic

HEURISTIC = Heuristic(
    "cost-to-go",
    "walls, the other slots, the length of all bodies, and what a change of direction costs",
    has_atlas=True,
)

_towed_way, _own_way = trailer_car.way, reeds_shepp.way


@kernel
def way(aim: Aim, chart: Chart) -> float:
    """Return the greater one of the costs [m] of the atlas and of the last axle's shortest path."""
    cost = cost_from(chart.costs, chart.frame, aim.goal_last, aim.last)
    return max(cost, _towed_way(aim, chart) if aim.bar > 0.0 else _own_way(aim, chart))
