"""Clip and transform observations before they are normalised."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from race_agents.training.settings import Settings
from race_server.core.observation import layout_of
from race_server.scenario.sensors import Lidar, Radar

RANGES, RADAR_RANGES = ("lidar", "lidar_before"), ("radar", "radar_before")
# Offsets [m], of which the last metre matters as much as the fifty before it.
OFFSETS = (
    *("goal_x", "goal_y", "goal_distance", "movers_x", "movers_y"),
    *("trailer_along", "trailer_across"),
)
# No wall can be nearer than this [m]: the body surrounds the lidar.
NEAREST = 0.05

Places = NDArray[np.intp]
NOWHERE: Places = np.zeros(0, np.intp)


@dataclass(frozen=True, eq=False)
class ObservationView:
    """Clips numbers at a horizon, and can take logarithms of ranges.

    Without a kart nearby an observation says 1000 m. That would be most of the variance, and a
    kart at 1 m would look like one at 5 m.

    Ten centimetres matter at a wall and not at the end of a straight, as in logarithms. A range of
    0 is a ray that dropped out, and becomes that of its farther neighbour; if they are 0 as well,
    it becomes the reach of the lidar. Offsets, which may be
    negative, become sign · log(1 + |metres|).
    """

    horizon: np.float32
    ranges: Places  # of what is learned as logarithms
    right: Places  # of their neighbours
    left: Places
    reach: NDArray[np.float64]  # [m] of each of them
    offsets: Places

    @classmethod
    def of(cls, settings: Settings) -> "ObservationView":
        """Return the view of settings."""
        horizon = np.float32(np.inf if settings.horizon is None else settings.horizon)
        slices = layout_of(settings.observation, settings.lidar.rays).slices
        reaches = {
            **(dict.fromkeys(RANGES, Lidar().reach) if settings.lidar.logarithms else {}),
            **(dict.fromkeys(RADAR_RANGES, Radar().reach) if settings.parking.logarithms else {}),
        }
        known = [name for name in reaches if name in slices]
        scans = [np.arange(slices[name].start, slices[name].stop) for name in known]
        far = [np.full(len(scan), reaches[name]) for name, scan in zip(known, scans, strict=True)]
        right = [np.append(scan[:1], scan[:-1]) for scan in scans]
        left = [np.append(scan[1:], scan[-1:]) for scan in scans]
        ranges, below, above = (np.concatenate([NOWHERE, *part]) for part in (scans, right, left))
        short = [name for name in OFFSETS if settings.parking.logarithms and name in slices]
        offsets = np.concatenate(
            [NOWHERE, *(np.arange(slices[name].start, slices[name].stop) for name in short)]
        )
        return cls(horizon, ranges, below, above, np.concatenate([np.zeros(0), *far]), offsets)

    def __call__(self, seen: NDArray[Any]) -> NDArray[Any]:
        """Return observations (..., size) as a network takes them."""
        seen = np.clip(seen, -self.horizon, self.horizon)
        if not len(self.ranges) and not len(self.offsets):
            return seen
        near = np.maximum(seen[..., self.right], seen[..., self.left])
        ranges = seen[..., self.ranges]
        filled = np.where(ranges > 0.0, ranges, near)
        filled = np.where(filled > 0.0, filled, self.reach)
        viewed = seen.astype(np.float64)
        viewed[..., self.ranges] = np.log(np.clip(filled, NEAREST, self.reach, dtype=np.float64))
        metres = viewed[..., self.offsets]
        viewed[..., self.offsets] = np.sign(metres) * np.log1p(np.abs(metres))
        return viewed

    def undone(self, viewed: NDArray[Any]) -> NDArray[Any]:
        """Return the observations (..., size) that this view was taken of."""
        seen = viewed.astype(np.float64)
        seen[..., self.ranges] = np.exp(seen[..., self.ranges])
        short = seen[..., self.offsets]
        seen[..., self.offsets] = np.sign(short) * np.expm1(np.abs(short))
        return seen
