"""A path of a vehicle with a trailer: its rear axle, and the angle at the hitch along it."""

from dataclasses import dataclass

import numpy as np

from race_agents.planning.path import Path
from race_server.core.state import Floats
from race_server.core.vehicles import Trailer


@dataclass(frozen=True)
class TowedPath(Path):
    """Short arcs of the rear axle that follow one another, with the trailer behind."""

    angles: Floats  # (A + 1,) [rad] at the hitch, at the ends of the arcs


def behind(poses: Floats, angles: Floats, trailer: Trailer) -> Floats:
    """Return poses of the axle of a trailer: (..., 3) x [m], y [m], heading [rad].

    poses: (..., 3) of the rear axle of the vehicle; angles: (...) at the hitch [rad].
    """
    heading, turned = poses[..., 2], poses[..., 2] - angles
    x = poses[..., 0] - trailer.hitch * np.cos(heading) - trailer.bar * np.cos(turned)
    y = poses[..., 1] - trailer.hitch * np.sin(heading) - trailer.bar * np.sin(turned)
    return np.stack([x, y, turned], axis=-1)


def before(poses: Floats, angles: Floats, trailer: Trailer) -> Floats:
    """Return poses of the rear axle of a vehicle whose trailer's axle has these poses."""
    turned, heading = poses[..., 2], poses[..., 2] + angles
    x = poses[..., 0] + trailer.bar * np.cos(turned) + trailer.hitch * np.cos(heading)
    y = poses[..., 1] + trailer.bar * np.sin(turned) + trailer.hitch * np.sin(heading)
    return np.stack([x, y, heading], axis=-1)
