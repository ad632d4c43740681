"""Rays through the grid against a plain search over all walls, and boxes in the way."""

import math

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from race_server.core import codes
from race_server.core.kernels.boxes import Hull
from race_server.core.kernels.geometry import (
    ROUGHNESS,
    cos_sin,
    distance_to_box,
    ray_to_box,
    rough_angle,
    wrap_angle,
)
from race_server.core.kernels.rays import Fan, cast_ray
from race_server.core.kernels.rng import bits, normal_of, uniform
from race_server.core.kernels.sensors import see_body
from race_server.core.kernels.wall_scan import scan_body, scan_walls
from race_server.scenario.sensors import fan
from race_server.scenario.track.walls import fence_of, pack_walls
from support.courses import SMALL_RING, ring
from support.lots import one_slot

WALLS = pack_walls(
    [fence_of(ring()), fence_of(SMALL_RING)]
)  # the second of two: its walls do not begin at 0
SITE = WALLS.sites[1]


def ray_to_segment(ray: tuple[float, float, float, float], wall: np.ndarray) -> float:
    """Return how far along a ray x, y, cos, sin a segment x0, y0, x1, y1 lies, or infinity.

    The ends of the segment count as hit.
    """
    x, y, cos, sin = ray
    x0, y0, x1, y1 = wall
    ex, ey = x1 - x0, y1 - y0
    along = cos * ey - sin * ex
    if along == 0.0:
        return math.inf
    dx, dy = x0 - x, y0 - y
    share = (dx * sin - dy * cos) / along
    if share < 0.0 or share > 1.0:
        return math.inf
    distance = (dx * ey - dy * ex) / along
    return distance if distance >= 0.0 else math.inf


def slow_range(x: float, y: float, angle: float, reach: float) -> float:
    cos, sin = math.cos(angle), math.sin(angle)
    return min(reach, *(ray_to_segment((x, y, cos, sin), wall) for wall in SMALL_RING.borders))


@settings(max_examples=200, deadline=None)
@given(st.floats(-math.pi, math.pi), st.floats(-0.69, 0.69), st.floats(-math.pi, math.pi))
def test_a_ray_through_the_grid_finds_what_a_search_over_all_walls_finds(
    around: float, offset: float, angle: float
) -> None:
    x, y = (6.0 + offset) * math.cos(around), (6.0 + offset) * math.sin(around)
    found, _ = cast_ray(WALLS, SITE, x, y, math.cos(angle), math.sin(angle), 8.0)
    assert found == pytest.approx(slow_range(x, y, angle, 8.0), abs=1e-9)


@pytest.mark.parametrize("angle", [0.0, math.pi / 2, math.pi, -math.pi / 2])
def test_a_ray_along_an_axis_of_the_grid_is_exact(angle: float) -> None:
    found, _ = cast_ray(WALLS, SITE, 6.0, 0.0, round(math.cos(angle)), round(math.sin(angle)), 8.0)
    assert found == pytest.approx(slow_range(6.0, 0.0, angle, 8.0), abs=1e-6)


def test_a_ray_that_runs_along_an_edge_between_cells_ends() -> None:
    # Cells of 1 m from -51 m on; rounding puts this ray on the edge, and its direction off it.
    walls = pack_walls([fence_of(one_slot())])
    distance, wall = cast_ray(walls, walls.sites[0], -8e-16, -42.0, -1.8e-16, -1.0, 20.0)
    assert (distance, wall >= 0) == (pytest.approx(8.0), True)


def test_a_ray_that_meets_nothing_returns_its_reach() -> None:
    assert cast_ray(WALLS, SITE, 6.0, 0.0, 0.0, 1.0, 0.5) == (0.5, -1)


@settings(max_examples=100, deadline=None)
@given(
    st.floats(-math.pi, math.pi),
    st.floats(-0.69, 0.69),
    st.floats(-math.pi, math.pi),
    st.sampled_from([(201, 200.0), (360, 359.0), (37, 90.0), (1080, 270.0)]),
)
def test_a_fan_laid_over_the_walls_sees_what_each_ray_sees(
    around: float, offset: float, angle: float, shape: tuple[int, float]
) -> None:
    x, y = (6.0 + offset) * math.cos(around), (6.0 + offset) * math.sin(around)
    cos, sin = math.cos(angle), math.sin(angle)
    field = math.radians(shape[1])
    rays = fan(shape[0], field)
    ranges = np.zeros(shape[0], np.float32)
    scan_walls(WALLS, SITE, Fan(x, y, cos, sin, rays, field, 8.0), ranges)
    for (c, s), found in zip(rays, ranges, strict=True):
        alone, _ = cast_ray(WALLS, SITE, x, y, cos * c - sin * s, sin * c + cos * s, 8.0)
        assert found == pytest.approx(alone, abs=1e-5)


@given(st.floats(-50.0, 50.0), st.floats(-50.0, 50.0))
def test_a_rough_angle_is_off_by_less_than_it_says(x: float, y: float) -> None:
    difference = wrap_angle(rough_angle(x, y) - math.atan2(y, x))
    assert abs(difference) < ROUGHNESS or (x == 0.0 and y == 0.0)


@given(st.floats(-20.0, 20.0))
def test_our_cosine_and_sine_are_the_library_s_to_the_last_digits(angle: float) -> None:
    cos, sin = cos_sin(angle)
    assert (cos, sin) == pytest.approx((math.cos(angle), math.sin(angle)), abs=4e-16)


def test_cosine_and_sine_of_no_turn_are_exact() -> None:
    assert cos_sin(0.0) == (1.0, 0.0)


def test_a_box_three_metres_ahead_is_hit_at_its_front() -> None:
    assert ray_to_box(-3.0, 0.0, 1.0, 0.0, 0.5, 0.2) == 2.5


def test_a_ray_past_a_box_misses_it() -> None:
    assert ray_to_box(-3.0, 0.3, 1.0, 0.0, 0.5, 0.2) == math.inf


def test_the_distance_to_a_turned_box_is_that_to_its_side() -> None:
    north = 0.0, 1.0, 2.0, 1.0  # where a box of 4 m by 2 m points, and half of both
    assert distance_to_box(4.0, 0.0, *north) == pytest.approx(3.0)
    assert distance_to_box(0.0, 4.0, *north) == pytest.approx(2.0)
    assert distance_to_box(0.5, -0.5, *north) == 0.0


def test_a_box_behind_is_not_hit() -> None:
    assert ray_to_box(3.0, 0.0, 1.0, 0.0, 0.5, 0.2) == math.inf


@given(
    st.floats(-6.0, 6.0),
    st.floats(-6.0, 6.0),
    st.floats(-math.pi, math.pi),
    st.floats(-math.pi, math.pi),
    st.sampled_from([(9, 120.0), (201, 200.0), (360, 359.0)]),
)
def test_a_fan_sees_a_body_exactly_where_its_rays_meet_the_box(
    x: float, y: float, angle: float, heading: float, shape: tuple[int, float]
) -> None:
    field = math.radians(shape[1])
    rays = fan(shape[0], field)
    ranges, kinds = np.full(shape[0], 5.0, np.float32), np.zeros(shape[0], np.uint8)
    cos, sin = math.cos(angle), math.sin(angle)
    looks = Fan(0.0, 0.0, cos, sin, rays, field, 5.0)
    body = Hull(x, y, heading, 0.1, 0.25, 0.1, 0)  # its box stands 0.1 m ahead, 0.5 m by 0.2 m
    see_body(looks, body, codes.KART_HIT, ranges, kinds)
    bc, bs = math.cos(heading), math.sin(heading)
    u, v = -(x * bc + y * bs) - 0.1, x * bs - y * bc
    # On its very outline both answers are right: the body is touched, and seen from outside.
    assume(abs(max(abs(u) - 0.25, abs(v) - 0.1)) > 1e-6)
    for (c, s), found, kind in zip(rays, ranges, kinds, strict=True):
        c, s = cos * c - sin * s, sin * c + cos * s
        alone = ray_to_box(u, v, c * bc + s * bs, s * bc - c * bs, 0.25, 0.1)
        assert found == pytest.approx(min(alone, 5.0), abs=1e-5)
        assert kind == (codes.KART_HIT if alone < 5.0 else codes.NOTHING)
    laid = np.full(shape[0], 5.0, np.float32)
    scan_body(looks, body, laid)
    assert laid == pytest.approx(ranges, abs=1e-5)


@given(st.floats(-100.0, 100.0))
def test_a_wrapped_angle_is_the_same_direction_within_one_turn(angle: float) -> None:
    wrapped = wrap_angle(angle)
    assert -math.pi <= wrapped < math.pi + 1e-12
    assert math.cos(wrapped) == pytest.approx(math.cos(angle), abs=1e-9)


def test_chance_is_uniform_and_the_same_for_the_same_counters() -> None:
    numbers = np.array([uniform(7, 1, tick, 3) for tick in range(4000)])
    assert numbers.mean() == pytest.approx(0.5, abs=0.02)
    assert numbers.min() >= 0.0
    assert numbers.max() < 1.0
    assert uniform(7, 1, 5, 3) == numbers[5]
    assert uniform(8, 1, 5, 3) != numbers[5]


def test_noise_has_mean_zero_and_deviation_one() -> None:
    numbers = np.array([normal_of(np.uint64(bits(7, 2, tick, 0))) for tick in range(4000)])
    assert numbers.mean() == pytest.approx(0.0, abs=0.05)
    assert numbers.std() == pytest.approx(1.0, abs=0.05)
