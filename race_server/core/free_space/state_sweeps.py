"""Sweeps over all states, until their costs are those of a step and of what is left then.

The costs are values of a semi-Lagrangian scheme (Falcone and Ferretti, "Semi-Lagrangian
Approximation Schemes for Linear and Hamilton-Jacobi Equations", SIAM 2013): that of a cell is the
least one of a step plus what lies between the cells around its end. Unlike moves from cell to cell
this rounds no place, so a centimetre aside of the slot costs what a centimetre costs.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from race_server.core.free_space.rig import Rig, Towed
from race_server.core.free_space.states import (
    AHEAD,
    BACK,
    DETOUR,
    LIGHT,
    TURNS,
    UNKNOWN,
    Costs,
    StateCosts,
    angle_of,
    place_of,
    state_after,
    weight_of,
)
from race_server.core.kernels.geometry import TURN
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.state import Floats

Flags = NDArray[np.bool_]

STEP = 2.0  # of the scheme, in cells
# Rates of the angle that steps are made with, as shares of the greatest.
RATES = (0.0, 1.0, -1.0)
# Share of what lies around the end of a step that has to be known.
KNOWN = 0.4
# Sweeps at most, and the change of a cost [m] below which none is made again.
SWEEPS, STILL = 400, 0.01


class _Work(NamedTuple):
    """Work space of the scheme."""

    steps: Floats  # (2, angles, TURNS, len(RATES), 4) see `_fill_steps`
    ends: Costs  # of the shape of the costs, see `Ends`
    onward: Costs  # the same, see `_choose_gears`
    is_open: Flags  # of the shape of the costs: which of them are to be found
    changed: Flags  # (2, angles, TURNS, rows) where a cost of a row changed in the last sweep
    changes: Flags  # the same in this one
    known: Costs  # (columns,) share of what lies around the ends of steps from a row
    total: Costs  # (columns,) [m] the cost there, times that share
    blocked: Costs  # (columns,) share that is not free
    least: Costs  # (columns,) [m]


def sweep_all(found: StateCosts, rig: Rig, ends: Costs) -> None:
    """Find costs that are UNKNOWN; all others stay. ends: costs where the end is known."""
    shape = found.costs.shape
    work = _Work(
        np.zeros((*shape[:3], len(RATES), 4)),
        ends,
        np.zeros(shape, np.float32),
        found.costs == UNKNOWN,
        np.ones(shape[:4], np.bool_),
        np.zeros(shape[:4], np.bool_),
        *np.zeros((4, shape[4]), np.float32),
    )
    _fill_steps(found, rig, work.steps)
    for _ in range(SWEEPS):
        _choose_gears(found, work.onward)
        _sweep(found, work)
        if not work.changes.any():
            break
        work.changed[...] = work.changes
        work.changes[...] = False


@large_kernel
def _fill_steps(found: StateCosts, rig: Rig, steps: Floats) -> None:
    """Fill where steps end that begin in a cell: rows, columns and headings on, and the angle."""
    grid = found.grid
    for gear in range(2):
        way = STEP * grid.cell * (1.0 if gear == AHEAD else -1.0)
        for number in range(steps.shape[1]):
            for turn in range(TURNS):
                angle = angle_of(found, number)
                start = Towed(0.0, 0.0, turn * TURN / TURNS, angle, 0.0)
                for rate in range(len(RATES)):
                    end = state_after(found, rig, start, RATES[rate], way)
                    step = steps[gear, number, turn, rate]
                    step[0], step[1] = end.y / grid.cell, end.x / grid.cell
                    step[2], step[3] = end.heading * TURNS / TURN, place_of(found, end.angle)


@large_kernel
def _choose_gears(found: StateCosts, onward: Costs) -> None:
    """Fill what is cheaper: driving on, or turning round first."""
    costs, cusp = found.costs, np.float32(found.cusp)
    for number in range(costs.shape[1]):
        for turn in range(TURNS):
            for row in range(costs.shape[3]):
                for column in range(costs.shape[4]):
                    ahead = costs[AHEAD, number, turn, row, column]
                    back = costs[BACK, number, turn, row, column]
                    onward[AHEAD, number, turn, row, column] = min(ahead, back + cusp)
                    onward[BACK, number, turn, row, column] = min(back, ahead + cusp)


@large_kernel
def _look_on(work: _Work, step: Floats, gear: int, row: int) -> None:
    """Fill what one step from each cell of a row leads to: known, total, blocked."""
    onward, known, total, blocked = work.onward, work.known, work.total, work.blocked
    rows, columns = onward.shape[3], onward.shape[4]
    known[:], total[:], blocked[:] = 0.0, 0.0, 0.0
    i, j, t = math.floor(step[0]), math.floor(step[1]), math.floor(step[2])
    a = min(int(step[3]), onward.shape[1] - 2)
    for corner in range(16):
        share = np.float32(weight_of(corner, step[0] - i, step[1] - j, step[2] - t, step[3] - a))
        line, shift = row + i + (corner >> 2 & 1), j + (corner >> 3)
        if share < LIGHT or not 0 <= line < rows:
            continue
        reached = onward[gear, a + (corner & 1), (t + (corner >> 1 & 1)) % TURNS, line]
        for column in range(max(0, -shift), min(columns, columns - shift)):
            cost = reached[column + shift]
            counted = share if cost < UNKNOWN else np.float32(0.0)
            known[column] += counted
            total[column] += counted * cost
            blocked[column] += share if cost > UNKNOWN else np.float32(0.0)


@large_kernel
def _sweep(found: StateCosts, work: _Work) -> None:
    """Make all costs those of a step and of what is left then, where that changed."""
    for gear in range(2):
        for number in range(found.costs.shape[1]):
            for turn in range(TURNS):
                steps = work.steps[gear, number, turn]
                for row in range(found.grid.rows):
                    if _leads_on(steps, row, work.changed):
                        _cost_least(found, work, steps, gear, row)
                        _end_here(work.ends[gear, number, turn, row], work.least)
                        work.changes[gear, number, turn, row] = _take(
                            work.least,
                            work.is_open[gear, number, turn, row],
                            found.costs[gear, number, turn, row],
                        )


@kernel
def _leads_on(steps: Floats, row: int, changed: Flags) -> bool:
    """Return whether steps from a row, (len(RATES), 4), lead to rows whose costs changed."""
    for rate in range(len(RATES)):
        i, t = math.floor(steps[rate, 0]), math.floor(steps[rate, 2])
        a = min(int(steps[rate, 3]), changed.shape[1] - 2)
        for corner in range(8):
            line, turn = row + i + (corner >> 2), (t + (corner >> 1 & 1)) % TURNS
            if 0 <= line < changed.shape[3]:
                number = a + (corner & 1)
                if changed[AHEAD, number, turn, line] or changed[BACK, number, turn, line]:
                    return True
    return False


@large_kernel
def _cost_least(found: StateCosts, work: _Work, steps: Floats, gear: int, row: int) -> None:
    """Fill the least costs of a row. steps: (len(RATES), 4)."""
    price = np.float32(STEP * found.grid.cell)
    detour = np.float32(DETOUR * found.scale)
    work.least[:] = UNKNOWN
    for rate in range(len(RATES)):
        _look_on(work, steps[rate], gear, row)
        for column in range(found.grid.columns):
            share = work.known[column]
            if share >= KNOWN:
                cost = work.total[column] / share + price + detour * work.blocked[column]
                work.least[column] = min(work.least[column], cost)


@kernel
def _end_here(ends: Costs, least: Costs) -> None:
    """Lower the costs of a row where the end is known."""
    for column in range(len(least)):
        least[column] = min(least[column], ends[column])


@kernel
def _take(least: Costs, is_open: Flags, costs: Costs) -> bool:
    """Put new costs in the place of those of a row, and return whether they are others."""
    changes = False
    for column in range(len(costs)):
        if is_open[column] and abs(least[column] - costs[column]) > STILL:
            costs[column] = least[column]
            changes = True
    return changes
