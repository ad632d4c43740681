"""States of a car, or of a vehicle with a trailer, and what they cost on the way to a place.

The angle of the front wheels decides on which curve the rear axle goes, and changes only by so much
on a metre; so does the angle at a hitch for the axle of the trailer. So a state is the pose of the
last axle, that angle, and the direction of the last motion (the gear). Its cost to go depends on
nothing else: not on the way on which the vehicle came.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from race_server.core.free_space.rig import Rig, Towed, curvature_of_rate, moved
from race_server.core.kernels.distance_field import Grid
from race_server.core.kernels.geometry import TURN, Pose, clip, seen_from
from race_server.core.kernels.jit import kernel

Costs = NDArray[np.float32]

TURNS = 72  # headings
AHEAD, BACK = 0, 1
# Cells of less weight than this do not count.
LIGHT = 1e-6
# Costs of what is not known, and of what is not free. Where a part of the cells between which a
# state lies is not free, that part of a detour [m], for the usual bar, is added.
UNKNOWN, BLOCKED = np.float32(1e4), np.float32(2e4)
DETOUR = 15.0


class Spot(NamedTuple):
    """Where a state lies in the frame of the goal."""

    across: float  # rows, not whole
    along: float  # columns, not whole
    heading: float  # [rad]


class StateCosts(NamedTuple):
    """Costs to go over cells, in the frame of the last axle's goal."""

    grid: Grid
    costs: Costs  # (2, angles, TURNS, rows, columns) [m], driving on AHEAD or BACK
    sharpest: float  # [rad] the last of the angles, and less than none the first
    rate: float  # [rad/m] greatest change of the angle on a metre of the front wheels
    cusp: float  # [m] cost of a change of direction
    scale: float  # of ways against those of the usual bar


@kernel
def angle_of(found: StateCosts, number: int) -> float:
    """Return one of the angles [rad]."""
    return found.sharpest * (2.0 * number / (found.costs.shape[1] - 1) - 1.0)


@kernel
def state_after(found: StateCosts, rig: Rig, towed: Towed, share: float, way: float) -> Towed:
    """Return the state after a short way [m] of the axle ahead, negative in reverse.

    share: of the greatest rate, at which the angle changes on it, -1 to 1, as far as the wheels
    can be turned.
    """
    angle = towed.angle + share * found.rate * abs(way)
    change = clip(angle, -found.sharpest, found.sharpest) - towed.angle
    curvature = curvature_of_rate(rig, towed.angle + 0.5 * change, change / way)
    return moved(rig, towed, clip(curvature, -rig.bend, rig.bend), way)


@kernel
def place_of(found: StateCosts, angle: float) -> float:
    """Return where an angle [rad] lies among the angles, not whole."""
    return 0.5 * (clip(angle / found.sharpest, -1.0, 1.0) + 1.0) * (found.costs.shape[1] - 1)


@kernel
def weight_of(corner: int, i: float, j: float, turn: float, angle: float) -> float:
    """Return the weight of one of 16 cells around a state, from shares of a cell."""
    weight = (angle if corner & 1 else 1.0 - angle) * (turn if corner & 2 else 1.0 - turn)
    return weight * (i if corner & 4 else 1.0 - i) * (j if corner & 8 else 1.0 - j)


@kernel
def spot_of(found: StateCosts, goal: Pose, towed: Towed) -> Spot:
    """Return where a state lies among the middles of cells."""
    grid = found.grid
    seen = seen_from(goal, Pose(towed.x, towed.y, towed.heading))
    across, along = (seen.y - grid.y0) / grid.cell - 0.5, (seen.x - grid.x0) / grid.cell - 0.5
    return Spot(across, along, seen.heading)


@kernel
def is_among(found: StateCosts, goal: Pose, towed: Towed) -> bool:
    """Return whether a state lies between middles of cells."""
    grid, spot = found.grid, spot_of(found, goal, towed)
    return bool(0.0 <= spot.across <= grid.rows - 1 and 0.0 <= spot.along <= grid.columns - 1)


@kernel
def cost_to_go(found: StateCosts, goal: Pose, towed: Towed, gear: int) -> float:
    """Return the cost to go [m] of a state that drives on AHEAD or BACK, between cells.

    It is UNKNOWN where the goal cannot be reached.
    """
    grid = found.grid
    across, along, heading = spot_of(found, goal, towed)
    row_at, column_at = clip(across, 0.0, grid.rows - 1.001), clip(along, 0.0, grid.columns - 1.001)
    beyond = grid.cell * (abs(across - row_at) + abs(along - column_at))
    turned, angle_at = heading * TURNS / TURN, place_of(found, towed.angle)
    i, j, t, a = (
        int(row_at),
        int(column_at),
        math.floor(turned),
        min(int(angle_at), found.costs.shape[1] - 2),
    )
    total, known = 0.0, 0.0
    for corner in range(16):
        weight = weight_of(corner, row_at - i, column_at - j, turned - t, angle_at - a)
        line, column = i + (corner >> 2 & 1), j + (corner >> 3)
        cost = found.costs[gear, a + (corner & 1), (t + (corner >> 1 & 1)) % TURNS, line, column]
        if cost < UNKNOWN:
            known += weight
            total += weight * cost
    if known < LIGHT:
        return float(UNKNOWN)
    return total / known + beyond + DETOUR * found.scale * (1.0 - known)
