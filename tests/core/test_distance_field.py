"""Distances to walls and to a goal, against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from race_server.core.kernels.boxes import Box
from race_server.core.kernels.distance_field import (
    Grid,
    cell_at,
    clear_of_box,
    clear_of_walls,
    distance_at,
    fill_cut_off,
    fill_distances,
)
from race_server.core.state import Floats

GRID = Grid(0.0, 0.0, 0.5, 40, 20)  # 20 by 10 metres
MOST = 3.0
GOAL = (2.25, 5.25)  # the middle of a cell


def clearance(*walls: tuple[float, float, float, float], grid: Grid = GRID) -> Floats:
    clear = np.full((grid.rows, grid.columns), MOST)
    clear_of_walls(grid, clear, np.array(walls, float).reshape(-1, 4), MOST)
    return clear


def field(
    clear: Floats, *, least: float = 0.5, has_diagonals: bool = True, grid: Grid = GRID
) -> Floats:
    distances = np.empty_like(clear)
    queues = np.empty((2, clear.size), np.int64)
    fill_distances(grid, clear, least, GOAL, has_diagonals, distances, queues)
    return distances


def in_steps(x: float, y: float) -> float:
    """Return the length of the shortest way of straight and diagonal steps on an empty plane."""
    long, short = max(abs(x), abs(y)), min(abs(x), abs(y))
    return long + (math.sqrt(2.0) - 1.0) * short


# The first example may compile.
unhurried = settings(max_examples=40, deadline=None)
cells = st.tuples(st.integers(0, GRID.rows - 1), st.integers(0, GRID.columns - 1))


@unhurried
@given(cells)
def test_on_an_empty_plane_a_distance_is_that_of_its_steps(cell: tuple[int, int]) -> None:
    x, y = (cell[1] + 0.5) * 0.5, (cell[0] + 0.5) * 0.5
    dx, dy = x - GOAL[0], y - GOAL[1]
    assert distance_at(GRID, field(clearance()), x, y) == pytest.approx(in_steps(dx, dy))
    straight = field(clearance(), has_diagonals=False)
    assert distance_at(GRID, straight, x, y) == pytest.approx(abs(dx) + abs(dy))


def test_between_the_middles_of_cells_a_distance_is_bilinear() -> None:
    # Three steps ahead 1.5 m, four 2 m; the same one row up: 2 diagonals less than a step more.
    distances = field(clearance())
    assert distance_at(GRID, distances, GOAL[0] + 1.75, GOAL[1]) == pytest.approx(1.75)
    corners = [in_steps(x, y) for x in (1.5, 2.0) for y in (0.0, 0.5)]
    middle = distance_at(GRID, distances, GOAL[0] + 1.75, GOAL[1] + 0.25)
    assert middle == pytest.approx(sum(corners) / 4.0)


def test_outside_the_grid_the_nearest_cell_counts() -> None:
    distances = field(clearance())
    assert cell_at(GRID, -3.0, 99.0) == (19, 0)
    assert distance_at(GRID, distances, -3.0, 99.0) == distances[19, 0]


def test_the_way_leads_around_the_end_of_a_wall() -> None:
    # From x 2.25 to 7.75 behind a wall at x 5 that reaches up to y 8.5: cells within 0.5 m of it
    # are closed, so the way leads over y 9.25, 4 m up and 4 m down. Two steps ahead over its end
    # are straight; each step up or down goes over a corner as long as there is way ahead.
    distances = field(clearance((5.0, -1.0, 5.0, 8.5)), least=0.51)
    ways = in_steps(4.75 - 2.25, 4.0) + 0.5 + in_steps(7.75 - 5.25, 4.0)
    assert distance_at(GRID, distances, 7.75, 5.25) == pytest.approx(ways)


def test_no_way_leads_through_a_closed_wall() -> None:
    distances = field(clearance((5.0, -1.0, 5.0, 11.0)), least=0.5)
    assert distance_at(GRID, distances, 7.75, 5.25) == math.inf
    assert np.isfinite(distances).sum() == 20 * 9  # cells of x up to 4.25


def test_no_step_leads_between_two_cells_that_meet_at_a_corner() -> None:
    clear = clearance()
    row, column = cell_at(GRID, *GOAL)
    around = [(row + i, column + j) for i, j in ((-1, 0), (1, 0), (0, -1), (0, 1))]
    for cell in around:
        clear[cell] = 0.0
    assert np.isfinite(field(clear)).sum() == 1


def test_a_goal_next_to_a_wall_is_reached() -> None:
    clear = clearance((0.0, 5.0, 2.5, 5.0))
    assert clear[cell_at(GRID, *GOAL)] == pytest.approx(0.25)
    distances = field(clear)
    assert distances[cell_at(GRID, *GOAL)] == 0.0
    assert np.isfinite(distances).sum() > 600


@unhurried
@given(*[st.floats(1.0, 9.0)] * 4)
def test_cells_know_the_distance_of_their_middle_from_a_wall(
    x0: float, y0: float, x1: float, y1: float
) -> None:
    clear = clearance((x0, y0, x1, y1))
    points = np.linspace([x0, y0], [x1, y1], 2001)
    for row, column in ((0, 0), (7, 9), (12, 4), (19, 39), (10, 10)):
        middle = np.array([(column + 0.5) * 0.5, (row + 0.5) * 0.5])
        apart = np.hypot(*(points - middle).T).min()
        assert clear[row, column] == pytest.approx(min(apart, MOST), abs=3e-3)


def test_a_box_is_solid() -> None:
    # 4 m long and 2 m wide around (10, 5), turned by a quarter: x from 9 to 11, y from 3 to 7.
    clear = clearance()
    clear_of_box(GRID, clear, Box(10.0, 5.0, 0.0, 1.0, 2.0, 1.0, 0), MOST)
    assert clear[cell_at(GRID, 9.25, 3.25)] == clear[cell_at(GRID, 10.75, 6.75)] == 0.0
    assert clear[cell_at(GRID, 8.25, 5.25)] == pytest.approx(0.75)
    assert clear[cell_at(GRID, 10.25, 8.75)] == pytest.approx(1.75)
    assert clear[cell_at(GRID, 12.25, 8.25)] == pytest.approx(math.hypot(1.25, 1.25))
    assert clear[0, 0] == MOST


random_walls = st.lists(
    st.tuples(st.floats(1.0, 19.0), st.floats(1.0, 9.0), st.floats(1.0, 19.0), st.floats(1.0, 9.0)),
    max_size=4,
)


def filled(
    clear: Floats, *, has_diagonals: bool = True, goal: tuple[float, float] = GOAL
) -> Floats:
    distances = np.empty_like(clear)
    queues = np.empty((2, clear.size), np.int64)
    fill_distances(GRID, clear, 0.5, goal, has_diagonals, distances, queues)
    fill_cut_off(GRID, distances, has_diagonals)
    return distances


@unhurried
@given(random_walls, st.booleans())
def test_cells_that_are_cut_off_are_one_step_from_their_nearest_neighbour(
    walls: list[tuple[float, float, float, float]], has_diagonals: bool
) -> None:
    clear = clearance(*walls)
    before, after = (
        field(clear, has_diagonals=has_diagonals),
        filled(clear, has_diagonals=has_diagonals),
    )
    known = np.isfinite(before)
    assert (after[known] == before[known]).all()
    assert np.isfinite(after).all()
    assert (after >= 0.0).all()
    padded = np.pad(after, 1, constant_values=np.inf)
    steps = [(0, 1, 0.5), (0, -1, 0.5), (1, 0, 0.5), (-1, 0, 0.5)]
    if has_diagonals:
        steps += [(i, j, math.sqrt(0.5)) for i in (1, -1) for j in (1, -1)]
    near = [padded[1 + i : 21 + i, 1 + j : 41 + j] + step for i, j, step in steps]
    assert after[~known] == pytest.approx(np.min(near, axis=0)[~known])


@unhurried
@given(random_walls)
def test_the_mirror_image_of_walls_has_the_mirror_image_of_ways(
    walls: list[tuple[float, float, float, float]],
) -> None:
    clear = clearance(*walls)
    mirrored = np.ascontiguousarray(clear[::-1])
    ways = filled(mirrored, goal=(GOAL[0], 10.0 - GOAL[1]))
    assert ways[::-1] == pytest.approx(filled(clear))


@unhurried
@given(random_walls, st.floats(0.0, 20.0), st.floats(0.0, 10.0), st.booleans())
def test_between_cells_a_way_changes_without_a_leap(
    walls: list[tuple[float, float, float, float]], x: float, y: float, is_on_a_line: bool
) -> None:
    ways = filled(clearance(*walls))
    if is_on_a_line:  # through middles of cells, where other cells begin to count
        x = 0.25 + 0.5 * math.floor(2.0 * x)
    at = distance_at(GRID, ways, x, y)
    for step in (-1e-7, 1e-7):
        assert distance_at(GRID, ways, x + step, y) == pytest.approx(at, abs=1e-4)
        assert distance_at(GRID, ways, x, y + step) == pytest.approx(at, abs=1e-4)
