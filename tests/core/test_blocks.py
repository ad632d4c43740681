"""Tests of how far vehicles are from blocks, and that none is looked at before they move so far."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from race_server.core import codes
from race_server.core.kernels.boxes import Box, box_count, box_of, hull_of
from race_server.core.kernels.contacts import box_on_box, gap_between
from race_server.core.lots import BLOCK, ROOM
from race_server.core.stages.blocks import (
    FARTHEST,
    Standing,
    block_hull,
    forget_rooms,
    may_touch_blocks,
)
from race_server.core.state import BODY, Record, Records
from race_server.core.vehicle_presets import KART_13, LORRY
from race_server.core.vehicles import vehicle_record

ANGLES = st.floats(-math.pi, math.pi)
PLACES = st.floats(-4.0, 4.0)


def upright(x: float, y: float, half: float) -> Box:
    """Return a square box along the axes."""
    return Box(x, y, 1.0, 0.0, half, half, 0)


def block_at(x: float, y: float, *, heading: float = 0.0, half: float = 0.5) -> Records:
    """Return one block, behind the place that the vehicle's own boxes have."""
    blocks = np.zeros(8, BLOCK).view(np.recarray)
    block = blocks[7]
    block.x, block.y, block.heading, block.kind = x, y, heading, codes.OBSTACLE
    block.half_length = block.half_width = half
    return blocks


def body_at(x: float, y: float, heading: float, *bends: float) -> Record:
    """Return a body; bends: angles of its trailers' headings against its own [rad]."""
    body = np.zeros(1, BODY).view(np.recarray)[0]
    body.x, body.y, body.heading = x, y, heading
    for trailer, bend in zip(body.trailers, bends, strict=False):
        trailer.heading = heading - bend
    return body


def touches(body: Record, vehicle: Record, blocks: Records) -> bool:
    """Return whether any box of a body overlaps a block, each looked at."""
    return any(
        box_on_box(box_of(hull_of(vehicle, body, number)), box_of(block_hull(block)))[0] > 0.0
        for number in range(box_count(vehicle))
        for block in blocks
        if block.kind != codes.NOTHING
    )


def test_two_squares_of_1_m_whose_middles_are_3_m_apart_have_a_gap_of_2_m() -> None:
    assert gap_between(upright(0.0, 0.0, 0.5), upright(3.0, 0.0, 0.5)) == pytest.approx(2.0)


def test_squares_that_overlap_have_no_gap() -> None:
    assert gap_between(upright(0.0, 0.0, 0.5), upright(0.9, 0.0, 0.5)) == pytest.approx(-0.1)


@given(PLACES, PLACES, ANGLES)
def test_a_gap_is_0_or_less_just_where_the_boxes_touch(x: float, y: float, turn: float) -> None:
    one = upright(0.0, 0.0, 1.0)
    other = Box(x, y, math.cos(turn), math.sin(turn), 1.5, 0.5, 0)
    depth, gap = box_on_box(one, other)[0], gap_between(one, other)
    assert depth == pytest.approx(max(-gap, 0.0), abs=1e-9)


def test_a_kart_is_not_measured_again_before_it_has_moved_as_far_as_it_is_from_a_block() -> None:
    vehicle, rooms = vehicle_record(KART_13)[0], np.zeros(1, ROOM).view(np.recarray)
    body, blocks = body_at(0.0, 0.0, 0.0), block_at(50.0, 0.0)
    assert not may_touch_blocks(body, vehicle, 0, 1, Standing(blocks, rooms))
    assert rooms[0].room == pytest.approx(FARTHEST, abs=1e-5)
    body.x = 0.9 * FARTHEST
    assert not may_touch_blocks(body, vehicle, 0, 1, Standing(blocks, rooms))
    assert rooms[0].x == 0.0
    body.x = 1.1 * FARTHEST
    assert not may_touch_blocks(body, vehicle, 0, 1, Standing(blocks, rooms))
    assert rooms[0].x == body.x


def test_a_block_that_comes_is_seen_once_rooms_are_forgotten() -> None:
    vehicle, rooms = vehicle_record(KART_13)[0], np.zeros(1, ROOM).view(np.recarray)
    body = body_at(0.0, 0.0, 0.0)
    assert not may_touch_blocks(body, vehicle, 0, 1, Standing(block_at(50.0, 0.0), rooms))
    forget_rooms(rooms)
    assert may_touch_blocks(body, vehicle, 0, 1, Standing(block_at(0.0, 0.0), rooms))


@settings(max_examples=30)
@given(st.lists(st.tuples(PLACES, PLACES, st.floats(-0.2, 0.2), ANGLES), min_size=1, max_size=4))
def test_no_block_is_passed_over_that_a_lorry_touches(
    moves: list[tuple[float, float, float, float]],
) -> None:
    vehicle, rooms = vehicle_record(LORRY)[0], np.zeros(1, ROOM).view(np.recarray)
    blocks = block_at(4.0, 2.5, heading=0.3, half=1.0)
    for x, y, turn, bend in moves:
        # Nearly the same place, and another one: most moves are small.
        for scale in (0.02, 1.0):
            body = body_at(scale * x, scale * y, turn, scale * bend)
            if touches(body, vehicle, blocks):
                assert may_touch_blocks(body, vehicle, 0, 1, Standing(blocks, rooms))
            else:
                may_touch_blocks(body, vehicle, 0, 1, Standing(blocks, rooms))
