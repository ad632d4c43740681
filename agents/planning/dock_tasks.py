"""Docks for vehicles with a trailer: a bay between parked trailers, and random starts in its yard.

The dock is the x axis, the yard lies above it; the bay is in the middle, and trailers stand in all
others with their rears at the dock. Sizes are those of a lorry; others in proportion to their width
and to their length.
"""

import math
from dataclasses import dataclass

import numpy as np

from race_agents.planning.towed_path import before
from race_server.core.kernels.geometry import Pose
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle

# Of the lorry: width and length [m].
USUAL_WIDTH, USUAL_LENGTH = 2.55, 16.5
# Half the width of the yard, how far aside of the bay a trailer's axle starts at most, how far from
# the middle of what is left of the yard before the parked trailers [m], for the usual length.
HALF_YARD, FARTHEST, ASIDE = 48.0, 25.0, 2.0
# How far off the dock's direction a vehicle starts, and the angle at its hitch at most [rad].
SLANT, BENT = math.radians(20.0), 0.2
# Parked trailers to each side of the bay; the rear of a trailer keeps this from the dock [m], for
# the usual length, as in the lot `dock-35`.
NEIGHBOURS, STAND_OFF = 9, 0.5


@dataclass(frozen=True)
class DockTask:
    """A bay, and the yard before it."""

    name: str
    pitch: float  # [m] from bay to bay
    depth: float  # [m] of the yard, from the dock to the wall across
    scale: float  # of lengths, 1 for the usual one
    length: float  # [m] of parked trailers
    width: float  # [m]

    def walls(self) -> Floats:
        """Return the walls around the yard: (P, 4) [m]."""
        half = HALF_YARD * self.scale
        line = [(-half, 0.0), (half, 0.0), (half, self.depth), (-half, self.depth)]
        return np.array([(*a, *b) for a, b in zip(line, [*line[1:], line[0]], strict=True)])

    def boxes(self) -> Floats:
        """Return the parked trailers: (B, 6), see `TowedPlanner.plan`."""
        middle = STAND_OFF * self.scale + 0.5 * self.length
        return np.array(
            [
                (side * number * self.pitch, middle, 0.0, 1.0, 0.5 * self.length, 0.5 * self.width)
                for number in range(1, NEIGHBOURS + 1)
                for side in (-1.0, 1.0)
            ]
        )

    def goal(self, vehicle: Vehicle) -> Pose:
        """Return the pose of the axle of a trailer that stands in the bay."""
        return Pose(0.0, STAND_OFF * self.scale + vehicle.trailers[0].behind, 0.5 * math.pi)

    def start(self, vehicle: Vehicle, random: np.random.Generator) -> tuple[Pose, float]:
        """Return a random pose of the rear axle, and the angle at the hitch [rad].

        The vehicle may touch something there.
        """
        free = 0.5 * (STAND_OFF * self.scale + self.length + self.depth)
        x = random.uniform(-FARTHEST, FARTHEST) * self.scale
        y = free + random.uniform(-ASIDE, ASIDE) * self.scale
        heading, angle = random.uniform(-SLANT, SLANT), random.uniform(-BENT, BENT)
        if random.random() < 0.5:
            heading += math.pi
        ahead = before(np.array([x, y, heading]), np.array(angle), vehicle.trailers[0])
        return Pose(*ahead.tolist()), float(angle)


def dock(vehicle: Vehicle, *, pitch: float, depth: float) -> DockTask:
    """Return a dock for a vehicle with a trailer. pitch, depth: of one for the lorry [m]."""
    trailer = vehicle.trailers[0]
    scale = vehicle.overall_length / USUAL_LENGTH
    pitch, depth = pitch * vehicle.overall_width / USUAL_WIDTH, depth * scale
    name = f"dock, pitch {pitch:.2f}, yard {depth:.1f}"
    return DockTask(name, pitch, depth, scale, trailer.length, trailer.width)


def docks(vehicle: Vehicle) -> list[DockTask]:
    """Return the tasks of the yardstick."""
    return [
        dock(vehicle, pitch=pitch, depth=depth)
        for depth in (38.0, 35.0, 30.0, 24.0)
        for pitch in (4.0, 3.5)
    ]
