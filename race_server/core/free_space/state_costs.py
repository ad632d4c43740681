"""What every state of a car still costs on the way to its place.

The angle of the front wheels decides on which curve the rear axle goes, and changes only by so much
on a metre. So a state is the pose of the rear axle, that angle, and the direction of the last
motion (the gear). Its cost to go depends on nothing else: not on the way on which the car came.

Costs are values of a semi-Lagrangian scheme (Falcone and Ferretti, "Semi-Lagrangian Approximation
Schemes for Linear and Hamilton-Jacobi Equations", SIAM 2013): that of a cell is the least one of a
step plus what lies between the cells around its end. Unlike moves from cell to cell this rounds
no place, so a centimetre aside of the slot costs what a centimetre costs. To land exactly in the
slot is never certain between cells, so costs are too high, everywhere by a few metres.
"""

import hashlib
import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from race_server.core.free_space.goal_cells import cell_pose, goal_cells
from race_server.core.free_space.obstacles import Obstacles, is_free
from race_server.core.free_space.rig import Rig, Towed, curvature_of_rate, moved, scale_of
from race_server.core.kernels.distance_field import Grid
from race_server.core.kernels.geometry import TURN, Pose, clip, seen_from
from race_server.core.kernels.jit import cache_root, kernel, large_kernel
from race_server.core.state import Floats
from race_server.kept_file import keep

Costs = NDArray[np.float32]
Flags = NDArray[np.bool_]

# Headings, angles, side of a cell [m] for the usual bar, and a step of the scheme in cells.
TURNS, ANGLES, CELL, STEP = 72, 5, 0.5, 2.0
# How far around the goal cells reach [m] for the usual bar; beyond, the way to them is added.
REACH = 25.0
AHEAD, BACK = 0, 1
# Rates of the angle that steps are made with, as shares of the greatest.
RATES = (0.0, 1.0, -1.0)
# Share of what lies around the end of a step that has to be known.
KNOWN = 0.4
# Sweeps at most, and the change of a cost [m] below which none is made again.
SWEEPS, STILL = 400, 0.01
# Cost [m] for the usual bar of standing askew at the goal by a cell or a heading, the most of them
# with which it still counts as standing there, and the cost, in cells, of standing before or behind
# it by one cell.
ASKEW, MOST_ASKEW, SHORT = 6.0, 2, 3.0
# Cells of less weight than this do not count.
LIGHT = 1e-6
# Costs of what is not known, and of what is not free. Where a part of the cells between which a
# state lies is not free, that part of a detour [m], for the usual bar, is added.
UNKNOWN, BLOCKED = np.float32(1e4), np.float32(2e4)
DETOUR = 15.0


class StateCosts(NamedTuple):
    """Costs to go over cells, in the frame of the rear axle's goal."""

    grid: Grid
    costs: Costs  # (2, ANGLES, TURNS, rows, columns) [m], driving on AHEAD or BACK
    sharpest: float  # [rad] the last of ANGLES, and less than none the first
    rate: float  # [rad/m] greatest change of the angle on a metre of the front wheels
    cusp: float  # [m] cost of a change of direction
    scale: float  # of ways against those of the usual bar


class _Work(NamedTuple):
    """Work space of the scheme."""

    steps: Floats  # (2, ANGLES, TURNS, len(RATES), 4) see `_fill_steps`
    onward: Costs  # of the shape of the costs, see `_choose_gears`
    changed: Flags  # (2, ANGLES, TURNS, rows) where a cost of a row changed in the last sweep
    changes: Flags  # the same in this one
    known: Costs  # (columns,) share of what lies around the ends of steps from a row
    total: Costs  # (columns,) [m] the cost there, times that share
    blocked: Costs  # (columns,) share that is not free
    least: Costs  # (columns,) [m]


def find_state_costs(
    obstacles: Obstacles,
    rig: Rig,
    goal: Pose,
    *,
    rate: float,
    cusp: float,
    cell: float = CELL,
) -> StateCosts:
    """Return the costs to go to a pose of the rear axle.

    rig: a car, see `rig_of_car`; rate: greatest change of the angle [rad/m]; cusp: cost of a change
    of direction [m]; cell: side of a cell [m] for the usual bar.
    """
    scale = scale_of(rig.bar)
    grid = goal_cells(obstacles.grid, goal, cell * scale, reach=REACH * scale)
    shape = (2, ANGLES, TURNS, grid.rows, grid.columns)
    costs = np.full(shape, BLOCKED, np.float32)
    found = StateCosts(grid, costs, rig.sharpest, rate, cusp, scale)
    _survey(obstacles, rig, goal, found)
    work = _Work(
        np.zeros((*shape[:3], len(RATES), 4)),
        np.zeros(shape, np.float32),
        np.ones(shape[:4], np.bool_),
        np.zeros(shape[:4], np.bool_),
        *np.zeros((4, grid.columns), np.float32),
    )
    _fill_steps(found, rig, work.steps)
    for _ in range(SWEEPS):
        _choose_gears(found, work.onward)
        _sweep(found, work)
        if not work.changes.any():
            break
        work.changed[...] = work.changes
        work.changes[...] = False
    return found


def kept_state_costs(
    obstacles: Obstacles,
    rig: Rig,
    goal: Pose,
    *,
    rate: float,
    cusp: float,
    cell: float = CELL,
) -> StateCosts:
    """Return the same as `find_state_costs`, kept in the cache: it takes ten seconds and more."""
    known = hashlib.sha256(Path(__file__).read_bytes())
    numbers = [*obstacles.grid, *rig.drawing, *rig.drawn, *rig[:6], *goal, rate, cusp, cell]
    for part in (np.array(numbers), obstacles.walls, obstacles.boxes):
        known.update(part.tobytes())
    path = cache_root() / "ways" / f"states-{known.hexdigest()[:24]}.npz"
    found = _read(path)
    if found is None:
        made = found = find_state_costs(obstacles, rig, goal, rate=rate, cusp=cusp, cell=cell)
        numbers = [*made.grid, *made[2:]]
        keep(path, lambda file: np.savez(file, costs=made.costs, numbers=numbers))
    return found


def _read(path: Path) -> StateCosts | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            x0, y0, cell, columns, rows, *others = file["numbers"].tolist()
            return StateCosts(Grid(x0, y0, cell, int(columns), int(rows)), file["costs"], *others)
    except (OSError, ValueError, KeyError, EOFError):
        return None


@kernel
def _angle_of(number: int, sharpest: float) -> float:
    """Return one of ANGLES [rad]."""
    return sharpest * (2.0 * number / (ANGLES - 1) - 1.0)


@large_kernel
def _survey(obstacles: Obstacles, rig: Rig, goal: Pose, found: StateCosts) -> None:
    """Fill UNKNOWN into all costs where there is room."""
    grid, costs = found.grid, found.costs
    for turn in range(TURNS):
        for row in range(grid.rows):
            for column in range(grid.columns):
                pose = cell_pose(grid, goal, row, column, turn, TURNS)
                if not is_free(obstacles, rig.drawn, pose):
                    continue
                for number in range(ANGLES):
                    costs[AHEAD, number, turn, row, column] = UNKNOWN
                    costs[BACK, number, turn, row, column] = UNKNOWN


@kernel
def state_after(found: StateCosts, rig: Rig, towed: Towed, share: float, way: float) -> Towed:
    """Return the state after a short way [m] of the front wheels, negative in reverse.

    share: of the greatest rate, at which the angle changes on it, -1 to 1.
    """
    angle = towed.angle + share * found.rate * abs(way)
    change = clip(angle, -found.sharpest, found.sharpest) - towed.angle
    curvature = curvature_of_rate(rig, towed.angle + 0.5 * change, change / way)
    return moved(rig, towed, curvature, way)


@kernel
def _place_of(found: StateCosts, angle: float) -> float:
    """Return where an angle [rad] lies among ANGLES, not whole."""
    return 0.5 * (clip(angle / found.sharpest, -1.0, 1.0) + 1.0) * (ANGLES - 1)


@large_kernel
def _fill_steps(found: StateCosts, rig: Rig, steps: Floats) -> None:
    """Fill where steps end that begin in a cell: rows, columns and headings on, and the angle."""
    grid = found.grid
    for gear in range(2):
        way = STEP * grid.cell * (1.0 if gear == AHEAD else -1.0)
        for number in range(ANGLES):
            for turn in range(TURNS):
                angle = _angle_of(number, found.sharpest)
                start = Towed(0.0, 0.0, turn * TURN / TURNS, angle, 0.0)
                for rate in range(len(RATES)):
                    end = state_after(found, rig, start, RATES[rate], way)
                    step = steps[gear, number, turn, rate]
                    step[0], step[1] = end.y / grid.cell, end.x / grid.cell
                    step[2], step[3] = end.heading * TURNS / TURN, _place_of(found, end.angle)


@large_kernel
def _choose_gears(found: StateCosts, onward: Costs) -> None:
    """Fill what is cheaper: driving on, or turning round first."""
    costs, cusp = found.costs, np.float32(found.cusp)
    for number in range(ANGLES):
        for turn in range(TURNS):
            for row in range(costs.shape[3]):
                for column in range(costs.shape[4]):
                    ahead = costs[AHEAD, number, turn, row, column]
                    back = costs[BACK, number, turn, row, column]
                    onward[AHEAD, number, turn, row, column] = min(ahead, back + cusp)
                    onward[BACK, number, turn, row, column] = min(back, ahead + cusp)


@kernel
def _weight(corner: int, i: float, j: float, turn: float, angle: float) -> float:
    """Return the weight of one of 16 cells around a state, from shares of a cell."""
    weight = (angle if corner & 1 else 1.0 - angle) * (turn if corner & 2 else 1.0 - turn)
    return weight * (i if corner & 4 else 1.0 - i) * (j if corner & 8 else 1.0 - j)


@large_kernel
def _look_on(work: _Work, step: Floats, gear: int, row: int) -> None:
    """Fill what one step from each cell of a row leads to: known, total, blocked."""
    onward, known, total, blocked = work.onward, work.known, work.total, work.blocked
    rows, columns = onward.shape[3], onward.shape[4]
    known[:], total[:], blocked[:] = 0.0, 0.0, 0.0
    i, j, t = math.floor(step[0]), math.floor(step[1]), math.floor(step[2])
    a = min(int(step[3]), ANGLES - 2)
    for corner in range(16):
        share = np.float32(_weight(corner, step[0] - i, step[1] - j, step[2] - t, step[3] - a))
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
        for number in range(ANGLES):
            for turn in range(TURNS):
                steps = work.steps[gear, number, turn]
                for row in range(found.grid.rows):
                    if _leads_on(steps, row, work.changed):
                        _cost_least(found, work, steps, gear, row)
                        _end_here(found, work.least, turn, row)
                        changes = _take(work.least, found.costs[gear, number, turn, row])
                        work.changes[gear, number, turn, row] = changes


@kernel
def _leads_on(steps: Floats, row: int, changed: Flags) -> bool:
    """Return whether steps from a row, (len(RATES), 4), lead to rows whose costs changed."""
    for rate in range(len(RATES)):
        i, t = math.floor(steps[rate, 0]), math.floor(steps[rate, 2])
        a = min(int(steps[rate, 3]), ANGLES - 2)
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
def _end_here(found: StateCosts, least: Costs, turn: int, row: int) -> None:
    """Lower the costs of a row where a vehicle stands at the goal, or nearly."""
    grid = found.grid
    goal_row, goal_column = int(-grid.y0 / grid.cell), int(-grid.x0 / grid.cell)
    askew = min(turn, TURNS - turn) + abs(row - goal_row)
    if askew <= MOST_ASKEW:
        for column in range(max(goal_column - 1, 0), min(goal_column + 2, grid.columns)):
            cost = SHORT * abs(column - goal_column) * grid.cell + ASKEW * askew * found.scale
            least[column] = min(least[column], np.float32(cost))


@kernel
def _take(least: Costs, costs: Costs) -> bool:
    """Put new costs in the place of those of a row, and return whether they are others."""
    changes = False
    for column in range(len(costs)):
        if costs[column] != BLOCKED and abs(least[column] - costs[column]) > STILL:
            costs[column] = least[column]
            changes = True
    return changes


@kernel
def cost_to_go(found: StateCosts, goal: Pose, towed: Towed, gear: int) -> float:
    """Return the cost to go [m] of a state that drives on AHEAD or BACK, between cells.

    It is UNKNOWN where the goal cannot be reached.
    """
    grid = found.grid
    seen = seen_from(goal, Pose(towed.x, towed.y, towed.heading))
    across, along = (seen.y - grid.y0) / grid.cell - 0.5, (seen.x - grid.x0) / grid.cell - 0.5
    row_at, column_at = clip(across, 0.0, grid.rows - 1.001), clip(along, 0.0, grid.columns - 1.001)
    beyond = grid.cell * (abs(across - row_at) + abs(along - column_at))
    turned, angle_at = seen.heading * TURNS / TURN, _place_of(found, towed.angle)
    i, j, t, a = int(row_at), int(column_at), math.floor(turned), min(int(angle_at), ANGLES - 2)
    total, known = 0.0, 0.0
    for corner in range(16):
        weight = _weight(corner, row_at - i, column_at - j, turned - t, angle_at - a)
        line, column = i + (corner >> 2 & 1), j + (corner >> 3)
        cost = found.costs[gear, a + (corner & 1), (t + (corner >> 1 & 1)) % TURNS, line, column]
        if cost < UNKNOWN:
            known += weight
            total += weight * cost
    if known < LIGHT:
        return float(UNKNOWN)
    return total / known + beyond + DETOUR * found.scale * (1.0 - known)
