"""What drivers ask for, as bodies take it. Free of rules of the game."""

import math

import numpy as np

from race_server.core.kernels.jit import kernel
from race_server.core.state import Floats, Records


@kernel
def take_controls(bodies: Records, controls: Floats) -> None:
    """Store what the drivers want until it is given again.

    bodies: (K,) BODY of one world; controls: (K, 4) steering [-1, 1], throttle [-1, 1], brake
    [0, 1], buttons. What is not a number counts as zero, what is out of range as the limit. They
    are rounded to the digits that a message and a recording hold.
    """
    for k in range(len(bodies)):
        body = bodies[k]
        body.steering_command = _share(controls[k, 0], -1.0)
        body.throttle = _share(controls[k, 1], -1.0)
        body.brake = _share(controls[k, 2], 0.0)
        buttons = controls[k, 3]
        body.buttons = int(buttons) if 0.0 <= buttons < 4.0 else 0


@kernel
def _share(value: float, low: float) -> float:
    """Return a share within [low, 1], rounded to single precision."""
    if math.isnan(value):
        return 0.0
    return float(np.float32(min(max(value, low), 1.0)))
