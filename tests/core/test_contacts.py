"""Boxes against walls and against each other."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from race_server.core.kernels.boxes import Box
from race_server.core.kernels.contacts import (
    Material,
    box_on_box,
    box_on_segment,
    impulse,
    touching_point,
)

BOX = Box(0.0, 0.0, 1.0, 0.0, 1.0, 0.5, 0)  # two metres long, one wide, heading east
MATERIAL, HALF = Material(0.3, 0.3), Material(0.5, 0.3)


def test_a_box_ten_centimetres_into_a_wall_on_its_left_is_pushed_right() -> None:
    depth, nx, ny = box_on_segment(BOX, -5.0, 0.4, 5.0, 0.4)
    assert (depth, nx, ny) == pytest.approx((0.1, 0.0, -1.0))


def test_a_box_beside_a_wall_does_not_touch_it() -> None:
    assert box_on_segment(BOX, -5.0, 0.6, 5.0, 0.6)[0] == 0.0


def test_a_wall_that_ends_before_the_box_does_not_touch_it() -> None:
    assert box_on_segment(BOX, 1.1, 0.0, 5.0, 0.0)[0] == 0.0


def test_a_wall_end_that_pokes_into_the_nose_pushes_the_box_back() -> None:
    depth, nx, ny = box_on_segment(BOX, 0.9, 0.0, 5.0, 0.01)
    assert (depth, nx, ny) == pytest.approx((0.1, -1.0, 0.0))


def test_two_boxes_side_by_side_are_pushed_apart_sideways() -> None:
    depth, nx, ny = box_on_box(BOX, BOX._replace(y=0.9))
    assert (depth, nx, ny) == pytest.approx((0.1, 0.0, -1.0))


angles = st.floats(-math.pi, math.pi)


@given(angles, angles, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_moving_a_box_out_along_the_normal_ends_the_contact(
    heading: float, other: float, x: float, y: float
) -> None:
    box = Box(x, y, math.cos(heading), math.sin(heading), 1.0, 0.5, 0)
    second = Box(0.0, 0.0, math.cos(other), math.sin(other), 1.0, 0.4, 0)
    depth, nx, ny = box_on_box(box, second)
    assert depth >= 0.0
    assert depth == 0.0 or math.hypot(nx, ny) == pytest.approx(1.0)
    freed = box_on_box(box._replace(x=x + depth * nx, y=y + depth * ny), second)
    assert freed[0] == pytest.approx(0.0, abs=1e-9)


@given(angles, angles, st.floats(-2.0, 2.0), st.floats(-2.0, 2.0))
def test_two_boxes_touch_each_other_equally(
    heading: float, other: float, x: float, y: float
) -> None:
    a = Box(x, y, math.cos(heading), math.sin(heading), 1.0, 0.5, 0)
    b = Box(0.0, 0.0, math.cos(other), math.sin(other), 1.0, 0.4, 0)
    assert box_on_box(a, b)[0] == pytest.approx(box_on_box(b, a)[0])


def test_a_flat_blow_acts_on_the_middle_of_the_side() -> None:
    assert touching_point(BOX, 0.0, -1.0) == pytest.approx((0.0, 0.5))


def test_bodies_that_separate_get_no_impulse() -> None:
    assert impulse(0.1, 3.0, 2.0, 2.0, MATERIAL) == (0.0, 0.0)


def test_a_blow_of_two_metres_a_second_with_half_restitution_gives_three_newton_seconds() -> None:
    assert impulse(-2.0, 0.0, 1.0, 1.0, HALF) == (3.0, 0.0)


def test_friction_is_bounded_by_the_normal_impulse() -> None:
    normal, tangent = impulse(-2.0, 100.0, 1.0, 1.0, HALF)
    assert tangent == pytest.approx(-0.3 * normal)
