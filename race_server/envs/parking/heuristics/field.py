"""Ways over cells to the slot of each vehicle: made at a reset, where a heuristic reads them.

The cells lie so that the slot is the middle of one. Cells that no way reaches, such as those that
touch an obstacle, continue the ways of their neighbours: so there is a way everywhere, and between
the middles of cells it changes without a leap.
"""

import math
from typing import NamedTuple

import numpy as np

from race_server.core import codes
from race_server.core.kernels.boxes import box_of
from race_server.core.kernels.distance_field import (
    Grid,
    clear_of_box,
    clear_of_walls,
    fill_cut_off,
    fill_distances,
)
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.rng import bits
from race_server.core.stages.blocks import block_hull
from race_server.core.state import Floats, Ints, Walls, World
from race_server.envs.parking.heuristics.aim import goal_of
from race_server.envs.parking.heuristics.atlas import NO_ATLAS, Atlas
from race_server.envs.parking.heuristics.heuristic import CORNERS, NO_CELLS, Chart, Costs

# [m] side of a cell: that of the report on an articulated vehicle that learns to park.
CELL = 1.0
# Cells whose middle is nearer to an obstacle than this [m] are closed: all that it touches are.
TOUCHES = CELL * math.sqrt(0.5)
# A place counts as the same within one part of these of a metre or of a radian.
PARTS = 1000.0
SHIFT = 1  # a digest of 63 bits is never negative
NEVER = -1


class Field(NamedTuple):
    """Ways of all vehicles of a batch. Axis letters: W worlds, K vehicles, R rows, C columns.

    A field is kept as long as lot, slot and obstacles stay what it was made for.
    """

    ways: Floats  # (W, K, R, C) [m]
    corners: Floats  # (W, K, 2) lowest corner of the cells [m]
    made_for: Ints  # (W, K) digest of lot, slot and obstacles
    clear: Floats  # (W, R, C) work space: of the first world of each part of the batch
    queues: Ints  # (W, 2, R * C) the same
    atlas: Atlas  # costs to go to the slots of all lots


@kernel
def cells_along(size: float) -> int:
    """Return how many cells cover a side [m] of a site, wherever its slot lies."""
    return math.ceil(size / CELL) + 1


def empty_field(
    walls: Walls, worlds: int, vehicles: int, cells: int, atlas: Atlas = NO_ATLAS
) -> Field:
    """Return the fields of a batch, not yet filled; without cells if none are read.

    walls: of all sites of the batch; cells: NO_CELLS, SIDES or CORNERS; atlas: of their slots.
    """
    rows = columns = 0
    if cells != NO_CELLS:
        rows, columns = (
            max(cells_along(float(site[side] * site["cell"])) for site in walls.sites)
            for side in ("rows", "columns")
        )
    return Field(
        np.zeros((worlds, vehicles, rows, columns)),
        np.zeros((worlds, vehicles, 2)),
        np.full((worlds, vehicles), NEVER),
        np.zeros((worlds, rows, columns)),
        np.zeros((worlds, 2, rows * columns), np.int64),
        atlas,
    )


@kernel
def _cells_before(low: float, goal: float) -> int:
    """Return how many cells lie before the one around a goal. low, goal: coordinates [m]."""
    return max(math.ceil((goal - low) / CELL - 0.5), 0)


@kernel
def chart_of(world: World, field: Field, w: int, place: int, k: int) -> Chart:
    """Return the ways to the slot of a vehicle.

    w: its world; place: number of that world in the whole batch.
    """
    site = world.walls.sites[world.rules[w].course]
    ways, corner = field.ways[place, k], field.corners[place, k]
    columns = min(cells_along(site.columns * site.cell), ways.shape[1])
    rows = min(cells_along(site.rows * site.cell), ways.shape[0])
    frame, costs = _page_of(world, field.atlas, w, k)
    return Chart(Grid(corner[0], corner[1], CELL, columns, rows), ways, frame, costs)


@kernel
def _page_of(world: World, atlas: Atlas, w: int, k: int) -> tuple[Grid, Costs]:
    """Return the costs to go to the slot of a vehicle, and the frame of their cells."""
    number = 0
    if len(atlas.frames) > 1:
        lot = world.parking.lots.lots[world.rules[w].course]
        number = lot.slot_start + world.parking.parkers[w, k].slot
    frame = atlas.frames[number]
    grid = Grid(frame[0], frame[1], frame[2], int(frame[3]), int(frame[4]))
    return grid, atlas.costs[number]


@kernel
def _what_for(world: World, w: int, k: int) -> int:
    """Return a digest of what a field depends on: lot, goal, width and obstacles of a vehicle."""
    course, vehicle = world.rules[w].course, world.vehicles[w, k]
    site, goal = world.walls.sites[course], goal_of(vehicle, world.parking.parkers[w, k])
    found = int(bits(course, k, _parts(goal.x - site.x0), _parts(goal.y - site.y0)) >> SHIFT)
    found = int(bits(found, _parts(vehicle.width), 0, 0) >> SHIFT)
    for block in world.parking.blocks[w]:
        if block.kind != codes.NOTHING:
            x, y = _parts(block.x - site.x0), _parts(block.y - site.y0)
            found = int(bits(found, _parts(block.heading + math.pi), x, y) >> SHIFT)
    return found


@kernel
def _parts(number: float) -> int:
    return max(int(PARTS * number), 0)


@large_kernel
def find_ways(world: World, field: Field, w: int, place: int, spare: int, cells: int) -> None:
    """Fill the fields of all vehicles of one world, where they are not what they were.

    w: the world; place: its number in the whole batch; spare: that of the first world of this
    part of it, whose work space is used; cells: SIDES or CORNERS.
    """
    site, clear = world.walls.sites[world.rules[w].course], field.clear[spare]
    for k in range(world.bodies.shape[1]):
        what = _what_for(world, w, k)
        if field.made_for[place, k] == what:
            continue
        field.made_for[place, k] = what
        goal, corner = (
            goal_of(world.vehicles[w, k], world.parking.parkers[w, k]),
            field.corners[place, k],
        )
        corner[0] = goal.x - (_cells_before(site.x0, goal.x) + 0.5) * CELL
        corner[1] = goal.y - (_cells_before(site.y0, goal.y) + 0.5) * CELL
        chart = chart_of(world, field, w, place, k)
        half_width = 0.5 * world.vehicles[w, k].width
        least = max(TOUCHES, half_width) if cells == CORNERS else TOUCHES
        _survey(world, w, chart.grid, clear, least)
        at, over_corners, queues = (goal.x, goal.y), cells == CORNERS, field.queues[spare]
        fill_distances(chart.grid, clear, least, at, over_corners, chart.ways, queues)
        fill_cut_off(chart.grid, chart.ways, over_corners)


@kernel
def _survey(world: World, w: int, grid: Grid, clear: Floats, most: float) -> None:
    """Fill how far [m] the middle of each cell is from an obstacle, up to `most` [m]."""
    site = world.walls.sites[world.rules[w].course]
    for row in range(grid.rows):
        for column in range(grid.columns):
            clear[row, column] = most
    last = site.wall_start + site.wall_count
    clear_of_walls(grid, clear, world.walls.segments[site.wall_start : last], most)
    for block in world.parking.blocks[w]:
        if block.kind != codes.NOTHING:
            clear_of_box(grid, clear, box_of(block_hull(block)), most)
