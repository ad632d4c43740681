"""What ways cost: metres, and changes of direction."""

from typing import NamedTuple

from race_server.core.kernels.jit import kernel

# Cost of a change of direction of a car [m].
CUSP = 3.0


class Prices(NamedTuple):
    """What a metre costs, at least 1, and what a change of direction does."""

    ahead: float  # driven forward
    back: float  # driven in reverse
    cusp: float = CUSP  # [m]


@kernel
def cost_of_way(way: float, prices: Prices) -> float:
    """Return the cost [m] of a way [m], negative in reverse."""
    return way * prices.ahead if way > 0.0 else -way * prices.back
