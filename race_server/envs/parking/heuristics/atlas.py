"""Costs to go to every slot of the lots of a batch: made once, before the first round.

They know the walls, and what may stand in the other slots; so they hold whatever a round draws
there, and are made once for a lot and a vehicle. What they leave out are blocks that a round draws
anywhere.
"""

import hashlib
import math
from pathlib import Path
from typing import IO, NamedTuple

import numpy as np

from race_server.core.free_space.ground import Ground
from race_server.core.free_space.obstacles import PASSING, cover_radius
from race_server.core.free_space.prices import Prices
from race_server.core.free_space.rig import Rig, rig_of, rig_of_car, scale_of
from race_server.core.free_space.towed_ways import TURNS, TowedWays, find_towed_ways
from race_server.core.kernels.distance_field import Grid
from race_server.core.kernels.geometry import TURN, Pose, seen_from
from race_server.core.kernels.jit import cache_root, kernel, large_kernel, source_digest
from race_server.core.lots import PARKER, Lots
from race_server.core.state import BODY, Floats, Ints, Record, Walls
from race_server.core.vehicles import Vehicle, vehicle_record
from race_server.envs.parking.heuristics.aim import aim_of
from race_server.envs.parking.heuristics.heuristic import Costs
from race_server.errors import ScenarioError
from race_server.kept_file import keep

# Distance kept from obstacles [m] with a trailer and without, and what a change of direction costs
# [m] for the usual bar.
MARGIN, CAR_MARGIN, CUSP = 0.2, 0.1, 6.0
# Cells that no way reaches continue those of their neighbours, at this cost of a metre: so
# it costs less to come back than to go on.
ASTRAY = 2.0


class Atlas(NamedTuple):
    """Costs to go to slots, in the frames of their goals. Axis letter: S slots of all lots."""

    costs: Costs  # (S, TURNS, R, C) [m] of places of the last axle
    frames: Floats  # (S, 5) x0, y0, side of a cell [m], columns, rows


# Of batches whose heuristic reads none.
NO_ATLAS = Atlas(np.zeros((1, 1, 1, 1), np.float32), np.zeros((1, 5)))


def make_atlas(lots: Lots, walls: Walls, vehicle: Vehicle, names: list[str]) -> Atlas:
    """Return the costs to go to all slots of lots.

    walls: of the same sites; vehicle: with one trailer or none; names: of the lots, for errors.

    Raises:
        ScenarioError: a lot has no slots, or draws blocks.
    """
    for lot, name in zip(lots.lots, names, strict=True):
        check_lot(lot, name, "the heuristic 'cost-to-go'")
    known = hashlib.sha256(source_digest().encode())
    for part in (lots.lots, lots.slots, walls.sites, walls.segments, vehicle_record(vehicle)):
        known.update(part.tobytes())
    path = cache_root() / "ways" / f"{known.hexdigest()[:24]}.npz"
    found = _read(path)
    if found is None:
        found = _made(lots, walls, vehicle)
        keep(path, lambda file: _write(file, found))
    return found


def check_lot(lot: Record, name: str, asking: str) -> None:
    """Check that costs to go to the slots of a lot hold whatever a round draws. asking: who asks.

    Raises:
        ScenarioError: it has no slots, or draws blocks.
    """
    if lot["slot_count"] == 0 or lot["blocks_most"] > 0:
        why = "draws blocks" if lot["slot_count"] else "has no slots"
        raise ScenarioError(
            f"lot {name!r} {why}: {asking} is for lots with slots whose obstacles stay where they "
            "are; choose another"
        )


def _read(path: Path) -> Atlas | None:
    try:
        with np.load(path, allow_pickle=False) as file:
            return Atlas(file["costs"], file["frames"])
    except (OSError, ValueError, KeyError, EOFError):
        return None


def _write(file: IO[bytes], atlas: Atlas) -> None:
    np.savez(file, allow_pickle=False, costs=atlas.costs, frames=atlas.frames)


def _made(lots: Lots, walls: Walls, vehicle: Vehicle) -> Atlas:
    rig = rig_of(vehicle, MARGIN, 1.0) if vehicle.trailers else rig_of_car(vehicle, CAR_MARGIN, 1.0)
    ground, every = Ground(), []
    for lot, site in zip(lots.lots, walls.sites, strict=True):
        first = int(site["wall_start"])
        segments = walls.segments[first : first + int(site["wall_count"])]
        for number in range(int(lot["slot_count"])):
            boxes = standing_in(lots, lot, number)
            goal = goal_in(lots.slots[int(lot["slot_start"]) + number], vehicle)
            every.append(_ways_to(goal, segments, boxes, rig, ground))
    rows, columns = (
        max(getattr(ways.grid, side) for ways in every) for side in ("rows", "columns")
    )
    atlas = Atlas(
        np.zeros((len(every), TURNS, rows, columns), np.float32), np.zeros((len(every), 5))
    )
    for place, ways in enumerate(every):
        grid = ways.grid
        atlas.frames[place] = grid.x0, grid.y0, grid.cell, grid.columns, grid.rows
        least = np.zeros((TURNS, grid.rows, grid.columns))
        _merge(ways, least)
        _continue(least, ASTRAY * grid.cell, np.zeros(least.size, np.int64))
        _smooth(least, atlas.costs[place])
    return atlas


def _ways_to(goal: Pose, walls: Floats, boxes: Floats, rig: Rig, ground: Ground) -> TowedWays:
    """Return the costs to go to a pose of the last axle, over all that lies between walls."""
    ends = walls.reshape(-1, 2)
    low, high = ends.min(axis=0, initial=math.inf), ends.max(axis=0, initial=-math.inf)
    lowest, highest = Pose(low[0], low[1], 0.0), Pose(high[0], high[1], 0.0)
    near = PASSING + max(cover_radius(rig.drawing), cover_radius(rig.drawn))
    obstacles = ground.obstacles(lowest, highest, walls, boxes, reach=1.0, near=near)
    distances = ground.distances_to(goal, obstacles, rig.drawn.half_width)
    return find_towed_ways(
        obstacles, distances, rig, goal, Prices(1.0, 1.0, CUSP * scale_of(rig.bar))
    )


def goal_in(slot: Record, vehicle: Vehicle) -> Pose:
    """Return where the last axle of a vehicle stands, straight in the middle of a slot."""
    parker, body = np.zeros(1, PARKER).view(np.recarray)[0], np.zeros(1, BODY).view(np.recarray)[0]
    parker.x, parker.y, parker.heading = slot["x"], slot["y"], slot["heading"]
    return Pose(*aim_of(body, vehicle_record(vehicle)[0], parker).goal_last)


def standing_in(lots: Lots, lot: Record, own: int) -> Floats:
    """Return the boxes of all that may stand in the slots of a lot but one of them: (B, 6).

    A box: x, y [m] of its middle, cosine and sine of its heading, half length, half width [m]. None
    where the lot leaves its slots free. own: number of that slot in the lot.
    """
    if lot["taken"] == 0.0:
        return np.zeros((0, 6))
    first = int(lot["slot_start"])
    others = np.delete(lots.slots[first : first + int(lot["slot_count"])], own)
    boxes = np.zeros((len(others), 6))
    boxes[:, 0], boxes[:, 1] = others["x"], others["y"]
    boxes[:, 2], boxes[:, 3] = np.cos(others["heading"]), np.sin(others["heading"])
    boxes[:, 4:] = 0.5 * lot["taken_length"], 0.5 * lot["taken_width"]
    return boxes


@large_kernel
def _merge(ways: TowedWays, least: Floats) -> None:
    """Fill the least costs on either way, (TURNS, rows, columns), of each cell and those around it.

    Moves lead over several cells, so that only some cells near a place are on the way from it.
    """
    turns, rows, columns = least.shape
    for turn in range(turns):
        for row in range(rows):
            for column in range(columns):
                least[turn, row, column] = math.inf
                for t in range(turn - 1, turn + 2):
                    for i in range(max(row - 1, 0), min(row + 2, rows)):
                        for j in range(max(column - 1, 0), min(column + 2, columns)):
                            for gear in range(2):
                                cost = ways.costs[gear, t % turns, i, j]
                                least[turn, row, column] = min(least[turn, row, column], cost)


@large_kernel
def _continue(costs: Floats, price: float, queue: Ints) -> None:
    """Fill what is infinite from the neighbours outwards, at a price [m] for each cell.

    costs: (TURNS, rows, columns); queue: as long as there are costs, work space.
    """
    turns, rows, columns = costs.shape
    head = count = 0
    for state in range(costs.size):
        turn, rest = state // (rows * columns), state % (rows * columns)
        if costs[turn, rest // columns, rest % columns] < math.inf:
            queue[count] = state
            count += 1
    while head < count:
        turn, rest = queue[head] // (rows * columns), queue[head] % (rows * columns)
        row, column, head = rest // columns, rest % columns, head + 1
        for t, i, j in (
            (turn, row, column - 1),
            (turn, row, column + 1),
            (turn, row - 1, column),
            (turn, row + 1, column),
            ((turn - 1) % turns, row, column),
            ((turn + 1) % turns, row, column),
        ):
            if 0 <= i < rows and 0 <= j < columns and costs[t, i, j] == math.inf:
                costs[t, i, j] = costs[turn, row, column] + price
                queue[count] = (t * rows + i) * columns + j
                count += 1


@large_kernel
def _smooth(costs: Floats, smooth: Costs) -> None:
    """Fill the mean of each cell and those around it. costs: (TURNS, rows, columns)."""
    turns, rows, columns = costs.shape
    for turn in range(turns):
        for row in range(rows):
            for column in range(columns):
                total, count = 0.0, 0
                for t in range(turn - 1, turn + 2):
                    for i in range(max(row - 1, 0), min(row + 2, rows)):
                        for j in range(max(column - 1, 0), min(column + 2, columns)):
                            total += costs[t % turns, i, j]
                            count += 1
                smooth[turn, row, column] = total / count


@kernel
def cost_from(costs: Costs, grid: Grid, goal: Pose, pose: Pose) -> float:
    """Return the cost to go [m] from a pose of the last axle, linear between cells.

    costs: (TURNS, R, C), at least as many cells as the grid has, which lies in the frame of the
    goal.
    """
    seen = seen_from(goal, pose)
    across = min(max((seen.y - grid.y0) / grid.cell - 0.5, 0.0), grid.rows - 1.001)
    along = min(max((seen.x - grid.x0) / grid.cell - 0.5, 0.0), grid.columns - 1.001)
    turned = seen.heading * TURNS / TURN
    row, column, turn = int(across), int(along), math.floor(turned)
    across, along, turned = across - row, along - column, turned - turn
    cost = 0.0
    for t in range(2):
        for i in range(2):
            for j in range(2):
                share = (turned if t else 1.0 - turned) * (across if i else 1.0 - across)
                share *= along if j else 1.0 - along
                cost += share * costs[(turn + t) % TURNS, row + i, column + j]
    return cost
