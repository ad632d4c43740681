"""An order to park: the slot, and the map of what stands around it."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from race_server.core import codes
from race_server.core.level import Level
from race_server.core.state import Floats, World


class Slot(NamedTuple):
    """A rectangle to park in."""

    x: float  # [m] of its middle
    y: float  # [m]
    heading: float  # [rad] of a vehicle parked in it
    length: float  # [m]
    width: float  # [m]


@dataclass(frozen=True, eq=False)
class ParkingOrder:
    """Where a vehicle is to park, and what is known to stand there when the order is given.

    Places are those of the observation's parts in the frame `lot`. People, and vehicles that
    drive, are not on the map: a driver has to see them.
    """

    slot: Slot
    level: Level  # how well the middle of the body has to stand in it
    walls: Floats  # (P, 4) x0, y0, x1, y1 [m]
    blocks: Floats  # (B, 5) x, y [m] of the middle, heading [rad], half length, half width [m]


def own_blocks_of(world: World, w: int, karts: Iterable[int]) -> list[int]:
    """Return the numbers of the blocks that these vehicles are once they stand."""
    count, trailers = world.bodies.shape[1], world.vehicles["trailer_count"][w]
    return [k + count * box for k in karts for box in range(1 + int(trailers[k]))]


def order_of(world: World, w: int, k: int) -> ParkingOrder:
    """Return the order of a vehicle that has a slot: kart k of world w."""
    parker = world.parking.parkers[w, k]
    slot = Slot(*(float(parker[name]) for name in Slot._fields))
    site = world.walls.sites[world.rules[w].course]
    walls = world.walls.segments[site.wall_start : site.wall_start + site.wall_count].copy()
    blocks = np.delete(world.parking.blocks[w], own_blocks_of(world, w, [k]))
    blocks = blocks[blocks["kind"] != codes.NOTHING]
    names = ("x", "y", "heading", "half_length", "half_width")
    standing = np.stack([blocks[name] for name in names], axis=1)
    return ParkingOrder(slot, Level.of(parker), walls, standing)
