"""Where vehicles are, as rows of numbers."""

from typing import Any

import numpy as np

from race_server.core.state import Floats


def poses_of(bodies: Any, vehicles: Any) -> Floats:
    """Return where vehicles are: (…, 4).

    x, y [m] and heading [rad] of the centre of gravity, and the angle at the first hitch [rad], 0
    without a trailer. bodies, vehicles: (…) BODY and VEHICLE.
    """
    heading = bodies["heading"]
    turned = heading - bodies["trailers"]["heading"][..., 0]
    angle = np.arctan2(np.sin(turned), np.cos(turned))
    has_trailer = vehicles["trailer_count"] > 0
    return np.stack([bodies["x"], bodies["y"], heading, np.where(has_trailer, angle, 0.0)], axis=-1)
