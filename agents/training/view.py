"""What a network is given of an observation, before it is normalised."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.training.settings import Settings
from race_server.core.observation import layout_of
from race_server.scenario.sensors import Lidar

RANGES = ("lidar", "lidar_before")
# Nearer [m] than this no wall can be: the body is around the lidar.
NEAREST = 0.05

Places = NDArray[np.intp]
NOWHERE: Places = np.zeros(0, np.intp)


@dataclass(frozen=True, eq=False)
class ObservationView:
    """Numbers are cut at a horizon; ranges can be learned as logarithms.

    Where nobody is near an observation says 1000 m. That would be most of the variance, and a
    kart at 1 m would look like one at 5 m.

    Ten centimetres matter at a wall and not at the end of a straight, which logarithms tell. A ray
    that came back as nothing, 0, is either as far as its farther neighbour, as one that dropped
    out, or, where they are nothing, too, as far as the lidar reaches.
    """

    horizon: np.float32
    ranges: Places  # of what is learned as logarithms
    right: Places  # of their neighbours
    left: Places
    reach: float = Lidar().reach  # [m]

    @classmethod
    def of(cls, settings: Settings) -> "ObservationView":
        """Return the view that settings ask for."""
        horizon = np.float32(np.inf if settings.horizon is None else settings.horizon)
        slices = layout_of(settings.observation, settings.lidar.rays).slices
        scans = [np.arange(slices[n].start, slices[n].stop) for n in RANGES if n in slices]
        if not settings.lidar.logarithms:
            scans = []
        right = [np.append(scan[:1], scan[:-1]) for scan in scans]
        left = [np.append(scan[1:], scan[-1:]) for scan in scans]
        places = [np.concatenate([NOWHERE, *part]) for part in (scans, right, left)]
        return cls(horizon, places[0], places[1], places[2])

    def __call__(self, seen: NDArray[Any]) -> NDArray[Any]:
        """Return observations (..., size) as a network is to see them."""
        seen = np.clip(seen, -self.horizon, self.horizon)
        if not len(self.ranges):
            return seen
        near = np.maximum(seen[..., self.right], seen[..., self.left])
        ranges = seen[..., self.ranges]
        filled = np.where(ranges > 0.0, ranges, near)
        filled = np.where(filled > 0.0, filled, self.reach)
        viewed = seen.astype(np.float64)
        viewed[..., self.ranges] = np.log(np.clip(filled, NEAREST, self.reach, dtype=np.float64))
        return viewed

    def undone(self, viewed: NDArray[Any]) -> NDArray[Any]:
        """Return observations (..., size) of which this is what is viewed."""
        seen = viewed.astype(np.float64)
        seen[..., self.ranges] = np.exp(seen[..., self.ranges])
        return seen
