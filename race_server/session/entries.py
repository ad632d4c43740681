"""What acts on a race, as a recording holds it."""

from dataclasses import dataclass

from race_server.acts import Act
from race_server.fleet import Placements
from race_server.serials import Granted
from race_server.state import Float32s, Ints


@dataclass(frozen=True, eq=False)
class Inputs:
    """The controls that act from a tick on, of those seats whose control changed."""

    tick: int
    seats: Ints  # (n,)
    controls: Float32s  # (n, 4) steering, throttle, brake, buttons
    sequences: Ints  # (n,) of the drivers' messages


# What acts on a race, in the order in which it does.
Entry = Inputs | Placements | Act | Granted
