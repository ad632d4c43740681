"""Slots to park in, with the walls around them and random starts: what planners are measured on.

The slot's mouth lies on the x axis, its middle below the origin, the aisle above. Sizes: NF P91-100
and P91-120, clear of walls. Behind a parallel slot of 2.00 m a wall stands 0.30 m beyond the kerb.
"""

import math
from dataclasses import dataclass

import numpy as np

from race_server.core.free_space.footprint import Point, convert
from race_server.core.free_space.ground import NO_BOXES
from race_server.core.kernels.geometry import Pose
from race_server.core.state import Floats
from race_server.core.vehicles import Vehicle

# Half the length of the aisle [m], and how far from the slot a vehicle starts along it at most.
HALF_AISLE, FARTHEST = 20.0, 10.0


@dataclass(frozen=True)
class ParkingTask:
    """A slot, and how to stand in it."""

    name: str
    width: float  # [m] of the slot along the aisle
    depth: float  # [m] of the slot
    aisle: float  # [m] width
    middle: float  # [m] from the slot's mouth to the middle of the parked body
    heading: float  # [rad] of the parked body
    aside: float  # [m] how far from the middle of the aisle a vehicle starts
    slant: float  # [rad] how far off the aisle's direction
    both_ways: bool  # vehicles come from both sides

    def walls(self) -> Floats:
        """Return the walls around slot and aisle: (P, 4) [m]."""
        half = 0.5 * self.width
        line = [
            (-HALF_AISLE, self.aisle),
            (-HALF_AISLE, 0.0),
            (-half, 0.0),
            (-half, -self.depth),
            (half, -self.depth),
            (half, 0.0),
            (HALF_AISLE, 0.0),
            (HALF_AISLE, self.aisle),
        ]
        return np.array([(*a, *b) for a, b in zip(line, [*line[1:], line[0]], strict=True)])

    def boxes(self) -> Floats:
        """Return the boxes that stand there: none."""
        return NO_BOXES

    def goal(self, vehicle: Vehicle) -> Pose:
        """Return the pose of the rear axle of a parked vehicle."""
        middle = np.array([0.0, -self.middle, self.heading])
        return Pose(*convert(middle, vehicle, Point.MIDDLE, Point.REAR_AXLE).tolist())

    def start(self, vehicle: Vehicle, random: np.random.Generator) -> Pose:
        """Return a random pose of the rear axle in the aisle; it may touch a wall."""
        x, y = random.uniform(-FARTHEST, FARTHEST), random.uniform(-self.aside, self.aside)
        heading = random.uniform(-self.slant, self.slant)
        if self.both_ways and random.random() < 0.5:
            heading += math.pi
        middle = np.array([x, 0.5 * self.aisle + y, heading])
        return Pose(*convert(middle, vehicle, Point.MIDDLE, Point.REAR_AXLE).tolist())


def bay(*, width: float, aisle: float, forward: bool) -> ParkingTask:
    """Return a slot at a right angle to the aisle. width, aisle: [m]."""
    way = "forward" if forward else "reverse"
    heading = math.copysign(0.5 * math.pi, -1.0 if forward else 1.0)
    return ParkingTask(
        f"bay {width:.1f}, {way}, aisle {aisle:.1f}",
        width,
        5.0,
        aisle,
        2.5,
        heading,
        0.8,
        math.radians(20.0),
        both_ways=True,
    )


def parallel(length: float, *, name: str) -> ParkingTask:
    """Return a slot along the aisle. length: [m]."""
    return ParkingTask(
        f"parallel {name}", length, 2.3, 3.5, 1.0, 0.0, 0.4, math.radians(10.0), both_ways=False
    )


def tasks(vehicle: Vehicle) -> list[ParkingTask]:
    """Return the tasks of the yardstick."""
    return [
        bay(width=2.5, aisle=6.0, forward=False),
        bay(width=2.5, aisle=5.0, forward=False),
        bay(width=2.3, aisle=5.0, forward=False),
        bay(width=2.5, aisle=6.0, forward=True),
        bay(width=2.5, aisle=5.0, forward=True),
        bay(width=2.3, aisle=5.0, forward=True),
        parallel(1.35 * vehicle.length, name="1.35 L"),
        parallel(1.25 * vehicle.length, name="1.25 L"),
        parallel(vehicle.length + 0.9, name="L + 0.9"),
        parallel(vehicle.length + 0.6, name="L + 0.6"),
    ]
