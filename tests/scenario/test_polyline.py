"""Distances to polylines and their crossings, against all pairs one by one."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from race_server.scenario.track.course import Floats
from race_server.scenario.track.polyline import crossings, nearest_on

counts = st.integers(1, 200)
seeds = st.integers(0, 10_000)


def walk(count: int, seed: int) -> Floats:
    """Return segments (N, 4) of a way that turns at random."""
    turns = np.random.default_rng(seed).normal(0.0, 0.6, count).cumsum()
    ends = np.cumsum(np.column_stack([np.cos(turns), np.sin(turns)]), axis=0)
    return np.hstack([np.vstack([np.zeros((1, 2)), ends[:-1]]), ends])


def distance(segment: Floats, point: Floats) -> float:
    start, along = segment[:2], segment[2:] - segment[:2]
    share = np.clip((point - start) @ along / (along @ along), 0.0, 1.0)
    return float(math.dist(point, start + share * along))


def is_crossed(one: Floats, other: Floats) -> bool:
    def side(start: Floats, end: Floats, point: Floats) -> float:
        (x, y), (u, v) = end - start, point - start
        return float(x * v - y * u)

    a, b, c, d = one[:2], one[2:], other[:2], other[2:]
    return side(a, b, c) * side(a, b, d) < -1e-12 and side(c, d, a) * side(c, d, b) < -1e-12


@settings(max_examples=25, deadline=None)
@given(counts, seeds)
def test_the_nearest_point_is_the_nearest_of_all_segments(count: int, seed: int) -> None:
    segments = walk(count, seed)
    points = np.random.default_rng(seed + 1).uniform(-20.0, 20.0, (9, 2))
    off, nearest = nearest_on(segments, points)
    for point, one, place in zip(points, off, nearest, strict=True):
        assert one == pytest.approx(min(distance(segment, point) for segment in segments))
        assert math.dist(point, place) == pytest.approx(one)


@settings(max_examples=25, deadline=None)
@given(st.integers(1, 70), seeds)
def test_crossings_are_those_of_all_pairs(count: int, seed: int) -> None:
    segments = walk(count, seed)
    pairs = [
        (first, second)
        for first in range(count)
        for second in range(first + 1, count)
        if is_crossed(segments[first], segments[second])
    ]
    assert [tuple(pair) for pair in crossings(segments).tolist()] == pairs
    of_first = [pair for pair in pairs if pair[0] == pairs[0][0]]
    assert [tuple(pair) for pair in crossings(segments, first_only=True).tolist()] == of_first


def test_two_diagonals_of_a_square_cross_once() -> None:
    assert crossings(np.array([[0.0, 0, 1, 1], [0, 1, 1, 0], [5, 5, 6, 6]])).tolist() == [[0, 1]]
