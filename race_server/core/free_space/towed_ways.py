"""How far a trailer still has to be driven to its place, as a car that its hitch steers.

To its trailer the vehicle ahead is a steering wheel: with the angle b held at the hitch, the bar L
and the hitch d behind the rear axle, the trailer's axle drives on a circle of the curvature

    sin b / (L cos b + d).

So ways over cells of place and heading, each with both bodies at a held angle, are costs to go that
know the obstacles, the length of both, and that a change of direction is dear; what they leave
out is the way on which the hitch comes to its angle. The cells lie in the frame of the goal, so
that its axis is the middle of a row. Ways are the same there and back: they are found from the
goal.
"""

import math
from typing import NamedTuple

import numpy as np

from race_server.core.free_space.goal_cells import cell_pose, goal_cells
from race_server.core.free_space.obstacles import Obstacles, is_free
from race_server.core.free_space.prices import Prices, cost_of_way
from race_server.core.free_space.rig import ANGLES, Rig, Towed, pose_ahead, scale_of
from race_server.core.kernels.distance_field import Grid, cell_at, distance_at
from race_server.core.kernels.geometry import TURN, Pose, along_arc, seen_from
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.state import Floats, Ints

# Headings, the side of a cell [m] for the usual bar, most cells of a heading: a larger area has
# larger ones; and the way from cell to cell, in cells.
TURNS, CELL, MOST_CELLS, STEP = 48, 1.0, 12_000, 3.0
AHEAD, BACK = 0, 1
# A cost is less than another if it is by this much [m].
LESS = 1e-9


class TowedWays(NamedTuple):
    """Costs to go over cells."""

    grid: Grid  # in the frame of the goal
    # (2, TURNS, rows, columns) [m], if the vehicle drives on AHEAD or BACK; infinite if cut off
    costs: Floats
    cusp: float  # [m] cost of a change of direction


# None are known.
NO_WAYS = TowedWays(Grid(0.0, 0.0, CELL, 0, 0), np.zeros((2, TURNS, 0, 0)), 0.0)


def find_towed_ways(
    obstacles: Obstacles, distances: Floats, rig: Rig, goal: Pose, prices: Prices
) -> TowedWays:
    """Return the costs to go to a pose of the axle of a trailer, wherever there is ground.

    distances: (rows, columns) [m] to the goal over cells of the obstacles' grid, infinite where
    they are cut off.
    """
    grid = goal_cells(obstacles.grid, goal, CELL * scale_of(rig.bar), most=MOST_CELLS)
    shape = (TURNS, grid.rows, grid.columns)
    room = np.zeros(shape, np.int64)
    _survey(obstacles, distances, rig, goal, grid, room)
    moves, prolongs = _moves(rig, grid.cell)
    ways = TowedWays(grid, np.full((2, *shape), math.inf), prices.cusp)
    queue, is_queued = np.zeros((2, 2 * room.size), np.int64)
    steps = STEP * grid.cell * prolongs
    costs = np.stack([[cost_of_way(way * step, prices) for step in steps] for way in (1.0, -1.0)])
    _spread(ways, room, moves, costs, queue, is_queued)
    return ways


def _moves(rig: Rig, cell: float) -> tuple[Ints, Floats]:
    """Return the cells that moves lead over, and the vehicle's way as a multiple of the trailer's.

    (TURNS, len(ANGLES), 3) columns, rows and turns from a heading, ahead; (len(ANGLES),).
    cell: side [m].
    """
    moves, prolongs = np.zeros((TURNS, len(ANGLES), 3), np.int64), np.ones(len(ANGLES))
    for number, share in enumerate(ANGLES):
        angle = share * rig.sharpest
        along = rig.bar * math.cos(angle) + rig.hitch
        curvature = math.sin(angle) / along
        prolongs[number] = (rig.bar + rig.hitch * math.cos(angle)) / along
        for turn in range(TURNS):
            start = Pose(0.0, 0.0, turn * TURN / TURNS)
            end = along_arc(start, curvature * cell, STEP)
            turned = round((end[2] - start.heading) * TURNS / TURN)
            moves[turn, number] = round(end[0]), round(end[1]), turned
    return moves, prolongs


@large_kernel
def _survey(
    obstacles: Obstacles, distances: Floats, rig: Rig, goal: Pose, grid: Grid, room: Ints
) -> None:
    """Note at which angles there is room: (TURNS, rows, columns), a bit for each of ANGLES."""
    for turn in range(TURNS):
        for row in range(grid.rows):
            for column in range(grid.columns):
                pose = cell_pose(grid, goal, row, column, turn, TURNS)
                if distance_at(obstacles.grid, distances, pose.x, pose.y) == math.inf:
                    continue
                if not is_free(obstacles, rig.drawn, pose):
                    continue
                for number in range(len(ANGLES)):
                    angle = ANGLES[number] * rig.sharpest
                    towed = Towed(pose.x, pose.y, pose.heading, angle, 0.0)
                    if is_free(obstacles, rig.drawing, pose_ahead(rig, towed)):
                        room[turn, row, column] |= 1 << number


@large_kernel
def _spread(
    ways: TowedWays, room: Ints, moves: Ints, prices: Floats, queue: Ints, is_queued: Ints
) -> None:
    """Fill the costs to go, from the goal outwards.

    room: see `_survey`; moves: see `_moves`; prices: (2, len(ANGLES)) [m] of a move AHEAD and BACK;
    queue, is_queued: (2 TURNS rows columns,), work space. A state is taken once more where its
    cost has become less: moves cost about the same, so that is seldom.
    """
    rows, columns, costs = ways.grid.rows, ways.grid.columns, ways.costs
    size, head, count = len(queue), 0, 0
    row, column = cell_at(ways.grid, 0.0, 0.0)
    for gear in range(2):
        costs[gear, 0, row, column] = 0.0
        queue[count] = (gear * TURNS * rows + row) * columns + column
        is_queued[queue[count]] = 1
        count += 1
    while count > 0:
        state = queue[head]
        head, count = (head + 1) % size, count - 1
        is_queued[state] = 0
        column, rest = state % columns, state // columns
        row, rest = rest % rows, rest // rows
        turn, gear = rest % TURNS, rest // TURNS
        for choice in range(2 * len(ANGLES)):
            number, way = choice >> 1, choice & 1
            # Whence this cell is reached with the angle held: what comes here ahead is found back.
            sign = -1 if way == AHEAD else 1
            before = (turn + sign * moves[turn, number, 2]) % TURNS
            heading = before if way == AHEAD else turn
            i = row + sign * moves[heading, number, 1]
            j = column + sign * moves[heading, number, 0]
            if not (0 <= i < rows and 0 <= j < columns) or room[before, i, j] == 0:
                continue
            # At one end the hitch may still be on its way to the angle.
            if not (room[turn, row, column] | room[before, i, j]) >> number & 1:
                continue
            cost = costs[gear, turn, row, column] + prices[way, number]
            cost += ways.cusp if way != gear else 0.0
            if cost < costs[way, before, i, j] - LESS:
                costs[way, before, i, j] = cost
                follower = ((way * TURNS + before) * rows + i) * columns + j
                if not is_queued[follower]:
                    is_queued[follower] = 1
                    queue[(head + count) % size] = follower
                    count += 1


@kernel
def _cost_near(ways: TowedWays, gear: int, turn: int, row: int, column: int, reach: int) -> float:
    """Return the least cost of a cell and those around it, in place and heading."""
    least, grid = math.inf, ways.grid
    for t in range(turn - reach, turn + reach + 1):
        for i in range(max(row - reach, 0), min(row + reach + 1, grid.rows)):
            for j in range(max(column - reach, 0), min(column + reach + 1, grid.columns)):
                least = min(least, ways.costs[gear, t % TURNS, i, j])
    return least


@large_kernel
def towed_way(ways: TowedWays, goal: Pose, pose: Pose, way: float) -> float:
    """Return the cost to go [m] from a pose of a trailer's axle; infinite if it is not known.

    way: on which the vehicle came, negative in reverse, 0 if it stood.
    """
    seen = seen_from(goal, pose)
    row, column = cell_at(ways.grid, seen.x, seen.y)
    turn = math.floor(seen.heading * TURNS / TURN + 0.5) % TURNS
    for reach in range(2):
        ahead = _cost_near(ways, AHEAD, turn, row, column, reach)
        back = _cost_near(ways, BACK, turn, row, column, reach)
        ahead += ways.cusp if way < 0.0 else 0.0
        back += ways.cusp if way > 0.0 else 0.0
        if min(ahead, back) < math.inf:
            return min(ahead, back)
    return math.inf
