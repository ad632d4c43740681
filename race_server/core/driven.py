"""Which vehicles are driven: whose controls act."""

import numpy as np
from numpy.typing import NDArray

from race_server.core import codes
from race_server.core.state import World


def are_driven(world: World, w: int = 0) -> NDArray[np.bool_]:
    """Return whose controls act: (K,), who races, or has finished and goes to a slot."""
    statuses, parkers = world.bodies["status"][w], world.parking.parkers[w]
    driven: NDArray[np.bool_] = statuses == codes.RACING
    if len(parkers) and races_first(world, w):
        goes = (parkers["length"] > 0.0) & (parkers["parked_tick"] == 0)
        driven = driven | ((statuses == codes.FINISHED) & goes)
    return driven


def races_first(world: World, w: int = 0) -> bool:
    """Return whether vehicles race along a line before they go to slots."""
    return int(world.route.courses[world.rules[w].course].line_count) > 0
