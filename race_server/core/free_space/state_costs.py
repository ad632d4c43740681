"""Costs to go to a place from every state of a car, or of a vehicle with a trailer.

To land exactly in the slot is never certain between cells, so costs are too high, everywhere by a
few metres. Where what states cost at the end is known in another way, those `Ends` take the place
of what cells say. Where finer cells around the goal are known already, coarse ones lead there.
"""

import hashlib
import inspect
from collections.abc import Callable
from pathlib import Path

import numpy as np

from race_server.core.free_space.goal_cells import cell_pose, goal_cells
from race_server.core.free_space.obstacles import Obstacles, is_free
from race_server.core.free_space.rig import Rig, Towed, is_towing, pose_ahead, scale_of
from race_server.core.free_space.state_sweeps import sweep_all
from race_server.core.free_space.states import (
    AHEAD,
    BACK,
    BLOCKED,
    TURNS,
    UNKNOWN,
    Costs,
    StateCosts,
    angle_of,
    cost_to_go,
    is_among,
)
from race_server.core.kernels.distance_field import Grid
from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.jit import cache_root, large_kernel, source_digest
from race_server.kept_file import keep

# Angles of the wheels of a car and at a hitch, and side of a cell [m] for the usual bar.
ANGLES, HITCHED, CELL = 5, 7, 0.5
# How far around the goal cells reach [m] for the usual bar, where not said; beyond, the way to them
# is added.
REACH = 25.0
# Cost [m] for the usual bar of standing askew at the goal by a cell or a heading, the most of them
# with which it still counts as standing there, and the cost, in cells, of standing before or behind
# it by one cell.
ASKEW, MOST_ASKEW, SHORT = 6.0, 2, 3.0

# Returns costs (2, angles, TURNS, rows, columns) [m] of states from which the end is known, UNKNOWN
# elsewhere; takes costs that say what is free.
Ends = Callable[[StateCosts], Costs]


def find_state_costs(
    obstacles: Obstacles,
    rig: Rig,
    goal: Pose,
    *,
    rate: float,
    cusp: float,
    cell: float = CELL,
    reach: float = REACH,
    ends: Ends | None = None,
    finer: StateCosts | None = None,
) -> StateCosts:
    """Return the costs to go to a pose of the last axle.

    rig: with a trailer, or a car, see `rig_of_car`; rate: greatest change of the angle [rad/m];
    cusp: cost of a change of direction [m]; cell: side of a cell, and how far around the goal cells
    reach, [m] for the usual bar; ends: none for those of cells at the goal; finer: costs of finer
    cells around the goal, which take the place of ends.
    """
    scale = scale_of(rig.bar)
    grid = goal_cells(obstacles.grid, goal, cell * scale, reach=reach * scale)
    shape = (2, HITCHED if is_towing(rig) else ANGLES, TURNS, grid.rows, grid.columns)
    costs = np.full(shape, BLOCKED, np.float32)
    found = StateCosts(grid, costs, rig.sharpest, rate, cusp, scale)
    _survey(obstacles, rig, goal, found)
    if finer is None:
        sweep_all(found, rig, (ends or _at_goal)(found))
    else:
        _take_over(finer, goal, found)
        sweep_all(found, rig, np.full_like(costs, UNKNOWN))
    return found


def kept_state_costs(
    obstacles: Obstacles,
    rig: Rig,
    goal: Pose,
    *,
    rate: float,
    cusp: float,
    cell: float = CELL,
    reach: float = REACH,
    ends: Ends | None = None,
    finer: StateCosts | None = None,
) -> StateCosts:
    """Return the same as `find_state_costs`, kept in the cache: it takes ten seconds and more."""
    known = hashlib.sha256(source_digest().encode())
    for source in (__file__, *([inspect.getfile(ends)] if ends is not None else [])):
        known.update(Path(source).read_bytes())  # holds no kernel that the digest of sources knows
    numbers = [*obstacles.grid, *rig.drawing, *rig.drawn, *rig[:6], *goal, rate, cusp, cell, reach]
    for part in (np.array(numbers), obstacles.walls, obstacles.boxes):
        known.update(part.tobytes())
    if finer is not None:
        known.update(finer.costs.tobytes())
    path = cache_root() / "ways" / f"states-{known.hexdigest()[:24]}.npz"
    found = _read(path)
    if found is None:
        made = found = find_state_costs(
            obstacles,
            rig,
            goal,
            rate=rate,
            cusp=cusp,
            cell=cell,
            reach=reach,
            ends=ends,
            finer=finer,
        )
        numbers = [*made.grid, *made[2:]]
        keep(path, lambda file: np.savez_compressed(file, costs=made.costs, numbers=numbers))
    return found


def _read(path: Path) -> StateCosts | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            x0, y0, cell, columns, rows, *others = file["numbers"].tolist()
            return StateCosts(Grid(x0, y0, cell, int(columns), int(rows)), file["costs"], *others)
    except (OSError, ValueError, KeyError, EOFError):
        return None


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
                for number in range(costs.shape[1]):
                    towed = Towed(pose.x, pose.y, pose.heading, angle_of(found, number), 0.0)
                    if is_towing(rig) and not is_free(
                        obstacles, rig.drawing, pose_ahead(rig, towed)
                    ):
                        continue
                    costs[AHEAD, number, turn, row, column] = UNKNOWN
                    costs[BACK, number, turn, row, column] = UNKNOWN


@large_kernel
def _take_over(finer: StateCosts, goal: Pose, found: StateCosts) -> None:
    """Fill the costs of states that lie among finer cells."""
    grid, costs = found.grid, found.costs
    for turn in range(TURNS):
        for row in range(grid.rows):
            for column in range(grid.columns):
                pose = cell_pose(grid, goal, row, column, turn, TURNS)
                for number in range(costs.shape[1]):
                    towed = Towed(pose.x, pose.y, pose.heading, angle_of(found, number), 0.0)
                    if not is_among(finer, goal, towed):
                        continue
                    for gear in range(2):
                        cost = cost_to_go(finer, goal, towed, gear)
                        if costs[gear, number, turn, row, column] == UNKNOWN and cost < UNKNOWN:
                            costs[gear, number, turn, row, column] = cost


def _at_goal(found: StateCosts) -> Costs:
    """Return what it costs to stand at the goal, or nearly."""
    grid, ends = found.grid, np.full_like(found.costs, UNKNOWN)
    goal_row, goal_column = int(-grid.y0 / grid.cell), int(-grid.x0 / grid.cell)
    for turn in range(TURNS):
        for row in range(grid.rows):
            askew = min(turn, TURNS - turn) + abs(row - goal_row)
            if askew <= MOST_ASKEW:
                for column in range(max(goal_column - 1, 0), min(goal_column + 2, grid.columns)):
                    short = SHORT * abs(column - goal_column) * grid.cell
                    ends[:, :, turn, row, column] = short + ASKEW * askew * found.scale
    return ends
