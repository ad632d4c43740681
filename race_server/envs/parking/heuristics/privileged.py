"""Coordinates of the slot, each to the power that its manoeuvring takes.

To the side a tractor with a trailer gets by brackets of the third degree of its two controls,
along its heading by those of the first: ways of e, e, e² and e³ for steps ahead, of the hitch, of
the trailer's heading and to the side. Rosenfelder et al. (2023) weigh the terms of a predictive
controller so. The lengths that make all of them metres are the bar.
"""

import math

from race_server.core.kernels.geometry import seen_from
from race_server.core.kernels.jit import kernel
from race_server.envs.parking.heuristics.aim import Aim
from race_server.envs.parking.heuristics.heuristic import Chart, Heuristic

HEURISTIC = Heuristic(
    "privileged",
    "that y takes more manoeuvring than heading, and that more than the hitch",
    has_trailer=True,
)


@kernel
def way(aim: Aim, chart: Chart) -> float:
    """Return |x| + L |b| + L |h|^(1/2) + (L² |y|)^(1/3) [m].

    x, y, h: of the trailer's axle and heading in the frame of where it is to stand; b: angle at
    the hitch; L: bar.
    """
    at, bar = seen_from(aim.goal_last, aim.last), aim.bar
    turning = bar * math.sqrt(abs(at.heading))
    return abs(at.x) + aim.bent + turning + (bar * bar * abs(at.y)) ** (1.0 / 3.0)
