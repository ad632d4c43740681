"""The shortest path of the trailer, as if it were a car.

A trailer that is reversed with the angle b at its hitch moves as a car with its bar as wheelbase
and its wheels turned by -b. So its axle turns on a radius of bar / tan(b) at least.
"""

import math

from race_server.core.kernels.jit import kernel
from race_server.core.kernels.reeds_shepp import shortest_length
from race_server.envs.parking.heuristics.aim import Aim
from race_server.envs.parking.heuristics.heuristic import Chart, Heuristic

HEURISTIC = Heuristic("trailer-car", "that a reversed trailer steers like a car", has_trailer=True)


@kernel
def way(aim: Aim, chart: Chart) -> float:
    """Return the length [m] of the trailer axle's shortest path, and bar times hitch angle."""
    radius = aim.bar / math.tan(aim.bend)
    return shortest_length(aim.last, aim.goal_last, radius) + aim.bent
