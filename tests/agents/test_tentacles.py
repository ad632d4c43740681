"""Arcs that the lidar judges: their shapes, and which one is taken."""

import math

import numpy as np
import pytest

from race_agents.drivers import tentacles, tentacles_report_b
from race_agents.drivers.tentacles import FREE, clearance_of, flatness_of, place_points, search_arc
from race_agents.drivers.tentacles_report_b import (
    ARCS,
    STRAIGHT,
    arc_curvature,
    arc_length,
    class_radius,
    free_length,
    longest,
    move_off,
)
from race_server.core.kernel_driver import KEPT, memory_size
from race_server.core.vehicle_presets import TT02
from race_server.core.vehicles import vehicle_record

FIELD = math.radians(200.0)
RAYS = 201

# The arcs of the report


def test_the_slowest_class_begins_at_the_turning_radius() -> None:
    assert class_radius(0, 1.0, 0.70) == pytest.approx(0.70)


def test_the_fastest_class_is_straight() -> None:
    assert math.isinf(class_radius(14, 1.0, 0.70))
    assert tentacles_report_b.class_length(14, 1.0) == pytest.approx(3.2 + 6.7)


def test_arc_0_is_hard_left_40_straight_and_80_hard_right() -> None:
    curvatures = [arc_curvature(arc, 0.5) for arc in range(ARCS)]
    assert curvatures[0] == 2.0
    assert curvatures[STRAIGHT] == 0.0
    assert curvatures[80] == -2.0
    assert curvatures == sorted(curvatures, reverse=True)


def test_straighter_arcs_are_longer() -> None:
    # e sqrt(10/40) is half of e = 2.7 m.
    assert arc_length(0, 3.2, 1.0) == pytest.approx(3.2)
    assert arc_length(10, 3.2, 1.0) == pytest.approx(3.2 + 1.35)
    assert arc_length(70, 3.2, 1.0) == pytest.approx(3.2 + 1.35)
    assert arc_length(STRAIGHT, 3.2, 1.0) == pytest.approx(5.9)


def test_the_straight_arc_ends_before_a_wall_ahead() -> None:
    # Points every 0.2 m; the last one within 1.5 m is at 1.4 m.
    assert free_length(np.full(RAYS, 1.5), 0, RAYS, FIELD, 0.0, 0.0, 4.0) == pytest.approx(1.4)


def test_a_half_circle_reaches_no_further_than_its_diameter() -> None:
    # Radius 0.5 m: it ends 1 m to the left, at 90°, where 1.1 m are free.
    half_circle = 0.5 * math.pi
    free = free_length(np.full(RAYS, 1.1), 0, RAYS, FIELD, 0.0, 2.0, half_circle)
    assert free == pytest.approx(half_circle)


def test_an_arc_that_leaves_the_lidars_field_ends_there() -> None:
    # The field ends at 100°, where an arc has turned by 200°: 10 of 18 points on a full circle.
    free = free_length(np.full(RAYS, 8.0), 0, RAYS, FIELD, 0.0, 2.0, math.pi)
    assert free == pytest.approx(math.pi * 11 / 20)


def test_of_equally_long_arcs_the_straightest_wins() -> None:
    lengths = np.ones(ARCS)
    assert longest(lengths, 0) == STRAIGHT
    lengths[[10, 60]] = 2.0
    assert longest(lengths, 0) == 60


def test_the_choice_moves_away_from_the_side_with_shorter_arcs() -> None:
    lengths = np.full(ARCS, 2.0)
    lengths[:STRAIGHT] = 1.0  # a wall along the left
    # Right of the last short one by three, no neighbour is short any more.
    assert move_off(lengths, 0, STRAIGHT, 0.1) == STRAIGHT + 3


def test_between_two_like_sides_the_choice_stays() -> None:
    lengths = np.full(ARCS, 1.0)
    lengths[STRAIGHT] = 2.0
    assert move_off(lengths, 0, STRAIGHT, 0.1) == STRAIGHT


# The arcs of the paper


def test_the_papers_sharpest_arc_has_a_radius_of_four_metres() -> None:
    # 8 m over 0.6 pi.
    assert tentacles.class_length(0, 1.0) == pytest.approx(8.0)
    assert tentacles.class_radius(0, 1.0) == pytest.approx(4.244, abs=1e-3)


def test_the_faster_the_wider_and_the_longer() -> None:
    radii = [tentacles.class_radius(number, 1.0) for number in range(15)]
    assert radii == sorted(radii)
    assert tentacles.speed_class(0.0) == 0
    assert tentacles.speed_class(30.0) == 14


def test_clearance_is_half_at_its_half_length_and_none_on_a_free_arc() -> None:
    assert clearance_of(4.5, 9.0, 0.45) == pytest.approx(0.5)
    assert clearance_of(9.0, 9.0, 0.45) == 0.0
    assert clearance_of(0.0, 9.0, 0.45) == 1.0


def test_no_wall_is_flat() -> None:
    assert flatness_of(0.0, 0.45) == 0.0
    assert 0.9 < flatness_of(2.0, 0.45) < 1.0


def found_along(ranges: np.ndarray, side: float, bend: float, length: float) -> np.ndarray:
    memory = np.zeros(memory_size(RAYS))
    memory[KEPT : KEPT + RAYS] = ranges
    place_points(memory, RAYS, FIELD, 0.0, 0.0)
    search_arc(memory, RAYS, math.radians(1.0), side, bend, length, vehicle_record(TT02)[0])
    return memory[KEPT + 4 * RAYS :]


def corridor(ahead: float, side: float) -> np.ndarray:
    """Return what is seen between two walls at `side` [m], with one `ahead` [m] across."""
    angles = np.radians(np.arange(-100.0, 101.0))
    with np.errstate(divide="ignore"):
        across = np.where(np.cos(angles) > 0.0, ahead / np.cos(angles), np.inf)
        return np.minimum(across, np.minimum(side / np.abs(np.sin(angles)), 8.0))


def test_a_wall_ahead_is_met_half_a_body_before_the_middle() -> None:
    found = found_along(corridor(2.0, 1.0), 1.0, 0.0, 3.0)
    assert found[FREE] == pytest.approx(2.0 - 0.225)


def test_walls_beside_are_in_the_support_area_but_do_not_stop() -> None:
    found = found_along(corridor(8.0, 0.3), 1.0, 0.0, 3.0)
    assert found[FREE] == 3.0
    assert found[tentacles.WALL] > 0.3
    assert found[tentacles.SUPPORT_FREE] < 0.5


def test_an_opening_to_the_left_is_taken() -> None:
    # A wall 0.8 m ahead, another on the right; to the left nothing.
    ranges = corridor(0.8, 1.0)
    ranges[101 + 20 :] = 8.0
    left = found_along(ranges, 1.0, 1.0 / 0.79, 1.0)[FREE]
    right = found_along(ranges, -1.0, 1.0 / 0.79, 1.0)[FREE]
    assert left == 1.0
    assert right < 0.9
