"""A corridor out of a scan, and the path of least bending through it."""

import math

import numpy as np
import pytest

from race_agents.planning.corridor import WIDTH, Walls, find_gates, largest_edge, write_gate
from race_agents.planning.gap_way import bend_to
from race_agents.planning.path_smoothing import (
    BEND,
    CHANGE,
    MAIN,
    NEXT,
    PLACE,
    SECOND,
    SIZE,
    Y,
    nearest_allowed,
    point_along,
    smooth_path,
    solve,
    speed_before,
)
from race_server.core.kernel_driver import KEPT, WORK, memory_size

RAYS = 181
FIELD = math.pi
NOWHERE = (-1, -1)  # the rays that look across the way driven
# With one ray a degree the 90th looks straight ahead.
AHEAD = 90


def test_the_row_to_work_with_holds_a_path() -> None:
    assert SIZE <= WORK


def test_the_edge_is_where_the_scan_jumps_most() -> None:
    ranges = np.full(RAYS, 1.0)
    ranges[100:] = 3.0
    ranges[120:] = 2.5
    assert largest_edge(ranges, 0, RAYS, FIELD, 0.3, NOWHERE) == 99


def test_an_edge_behind_which_the_way_driven_lies_is_not_the_way_on() -> None:
    ranges = np.full(RAYS, 1.0)
    ranges[40:80] = 2.0
    ranges[150:] = 4.0
    assert largest_edge(ranges, 0, RAYS, FIELD, 0.3, NOWHERE) == 149
    assert largest_edge(ranges, 0, RAYS, FIELD, 0.3, (150, 170)) == 39


def test_a_wall_at_a_flat_angle_is_no_edge() -> None:
    # 0.5 m to the left: ranges rise from ray to ray, at 8° by 0.5 m.
    angles = np.radians(np.arange(-90.0, 91.0))
    with np.errstate(divide="ignore"):
        ranges = np.minimum(0.5 / np.abs(np.sin(angles)), 8.0)
    ranges[: AHEAD + 8] = ranges[AHEAD + 8]
    assert np.diff(ranges).min() < -0.3
    assert largest_edge(ranges, 0, RAYS, FIELD, 0.3, NOWHERE) == -1


def scan_of(left: list[tuple[float, float]], right: list[tuple[float, float]]) -> np.ndarray:
    """Return a memory with these points, those of each wall from the rear on."""
    rays = len(left) + len(right)
    memory = np.zeros(memory_size(rays))
    points = np.array(right + left[::-1])
    memory[KEPT + 2 * rays : KEPT + 4 * rays] = points.T.ravel()
    return memory


def test_between_straight_walls_gates_lie_across() -> None:
    places = np.arange(0.0, 5.1, 0.1)
    memory = scan_of([(x, 0.5) for x in places], [(x, -0.5) for x in places])
    rays, out = 2 * len(places), KEPT + 8 * len(places)
    gates, closed = find_gates(Walls(memory, rays, len(places) - 1, 0.0, 1.0), out, 0.5, 0.3, 0.2)
    assert not closed
    assert gates == 9  # every half metre or a little more, as the rungs fall
    assert memory[out + WIDTH : out + WIDTH + gates] == pytest.approx(1.0, abs=0.01)


def test_where_the_walls_meet_the_way_is_closed() -> None:
    places = np.arange(0.0, 2.1, 0.1)
    left = [(x, 0.5 - 0.25 * x) for x in places]
    memory = scan_of(left, [(x, -y) for x, y in left])
    rays, out = 2 * len(places), KEPT + 8 * len(places)
    gates, closed = find_gates(Walls(memory, rays, len(places) - 1, 0.0, 1.0), out, 0.3, 0.4, 0.1)
    assert closed
    assert 3 <= gates <= 4  # to 1.2 m, where the walls are 0.4 m apart


def path_through(gates: list[tuple[float, float, float, float]], margin: float) -> np.ndarray:
    """Return the row of numbers of a path through gates: right end, left end."""
    memory = np.zeros(WORK)
    for number, ends in enumerate(gates):
        write_gate(memory, 0, number, *ends)
    smooth_path(memory, 0, len(gates), 0.0, 0.2, margin, 0.1)
    return memory


def test_straight_on_there_is_nothing_to_bend() -> None:
    memory = path_through([(x, -0.5, x, 0.5) for x in (0.5, 1.0, 1.5, 2.0)], 0.2)
    assert memory[PLACE : PLACE + 4] == pytest.approx(0.5)
    assert memory[BEND : BEND + 4] == pytest.approx(0.0, abs=1e-9)
    # No bend: only braking from the end counts, 1 + 2 · 2 · 2 = 9.
    assert speed_before(memory, 0, 4, 1.0, 5.0, 1.0, 2.0) == pytest.approx(3.0, abs=0.01)
    assert point_along(memory, 0, 4, 0.75) == pytest.approx((0.75, 0.0))


def test_a_path_stays_off_the_end_of_a_gate_that_is_in_its_way() -> None:
    gates = [(x, -0.5, x, 0.5) for x in (0.5, 1.0, 1.5, 2.0)]
    gates[2] = (1.5, 0.1, 1.5, 1.1)
    memory = path_through(gates, 0.2)
    assert memory[Y + 2] == pytest.approx(0.3, abs=0.02)
    assert memory[BEND + 2] < 0.0 < memory[BEND]


def test_out_of_a_quarter_circle_a_path_runs_wide() -> None:
    # Walls of radius 2 and 1 m about (0, 1.5): in the middle the way bends by 1 / 1.5 m.
    turns = np.radians(np.arange(10.0, 91.0, 10.0))
    outer = [(2.0 * math.sin(a), 1.5 - 2.0 * math.cos(a)) for a in turns]
    inner = [(math.sin(a), 1.5 - math.cos(a)) for a in turns]
    memory = path_through([(*right, *left) for right, left in zip(outer, inner, strict=True)], 0.2)
    assert memory[PLACE + 8] < 0.4
    assert memory[BEND : BEND + 9].max() < 1.0 / 1.6


def test_five_diagonals_are_solved() -> None:
    full = np.array([[4.0, 1.0, 0.5], [1.0, 5.0, 2.0], [0.5, 2.0, 6.0]])
    memory = np.zeros(WORK)
    memory[MAIN : MAIN + 3] = np.diag(full)
    memory[NEXT : NEXT + 2] = np.diag(full, 1)
    memory[SECOND] = full[0, 2]
    memory[CHANGE : CHANGE + 3] = full @ [1.0, 2.0, 3.0]
    solve(memory, 0, 3)
    assert memory[CHANGE : CHANGE + 3] == pytest.approx([1.0, 2.0, 3.0])


def test_a_gate_too_narrow_is_passed_in_the_middle() -> None:
    assert nearest_allowed(0.0, 1.0, 0.25) == 0.25
    assert nearest_allowed(0.9, 1.0, 0.25) == 0.75
    assert nearest_allowed(0.0, 0.4, 0.25) == 0.2


def test_a_point_abreast_lies_on_a_half_circle() -> None:
    # 1 m to the left: the circle has a radius of 0.5 m.
    assert bend_to(0.0, 1.0, 0.0) == pytest.approx(2.0)
    assert bend_to(1.0, 0.0, 0.0) == 0.0
