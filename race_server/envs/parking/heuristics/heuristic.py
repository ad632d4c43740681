"""What is known of a heuristic, and what one reads."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from race_server.core.kernels.distance_field import Grid
from race_server.core.state import Floats

Costs = NDArray[np.float32]

# Which ways over cells a heuristic reads: none; from side to side, past obstacles as they are; or
# over corners as well, past obstacles grown by half the width of the vehicle.
NO_CELLS, SIDES, CORNERS = range(3)


@dataclass(frozen=True)
class Heuristic:
    """A heuristic by name."""

    name: str
    knows: str  # that the others may not
    cells: int = NO_CELLS
    has_trailer: bool = False  # only for vehicles with one trailer
    has_atlas: bool = False  # reads the costs to go of an atlas: for one trailer at most


class Chart(NamedTuple):
    """Ways to the slot of one vehicle over cells; without cells where no heuristic reads them."""

    grid: Grid
    ways: Floats  # (R, C) [m], at least as many as the grid has
    frame: Grid  # of the costs to go, in the frame of the goal
    costs: Costs  # (T, R, C) [m] of headings and places, at least as many as the frame has
