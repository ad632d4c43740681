"""Shortest paths of a car that drives both ways, against known lengths and another program."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from race_server.core.kernels.geometry import Pose, along_arc, seen_from
from race_server.core.kernels.reeds_shepp import (
    WORDS,
    least_cost,
    least_effort,
    pose_along,
    shortest_length,
    shortest_word,
    word_between,
)

ORIGIN = Pose(0.0, 0.0, 0.0)
# The first example may compile.
unhurried = settings(max_examples=40, deadline=None)

places = st.floats(-8.0, 8.0)
poses = st.builds(Pose, places, places, st.floats(-math.pi, math.pi))
radii = st.floats(0.5, 5.0)


def gap(pose: Pose, other: Pose) -> float:
    turn = math.remainder(pose.heading - other.heading, 2.0 * math.pi)
    return max(abs(pose.x - other.x), abs(pose.y - other.y), abs(turn))


@pytest.mark.parametrize(
    ("goal", "length"),
    [
        (Pose(0.0, 0.0, math.pi), math.pi),  # three arcs of 60°
        (Pose(0.0, 0.0, 0.5 * math.pi), 0.5 * math.pi),
        (Pose(0.0, 2.0, math.pi), math.pi),  # half a circle
        (Pose(1.0, 1.0, 0.5 * math.pi), 0.5 * math.pi),  # a quarter
        (Pose(5.0, 0.0, 0.0), 5.0),
        (Pose(-3.0, 0.0, 0.0), 3.0),
    ],
)
def test_a_path_of_a_few_arcs_is_as_long_as_they_are(goal: Pose, length: float) -> None:
    assert shortest_length(ORIGIN, goal, 1.0) == pytest.approx(length, abs=1e-12)


@pytest.mark.parametrize(
    ("aside", "length"), [(0.1, 0.8855), (1.0, 2.6362), (2.0, 3.6470), (4.0, 5.4781)]
)
def test_sideways_takes_far_more_way_than_it_gains(aside: float, length: float) -> None:
    assert shortest_length(ORIGIN, Pose(0.0, aside, 0.0), 1.0) == pytest.approx(length, abs=5e-5)


@pytest.mark.parametrize(
    ("goal", "effort"),
    [
        (Pose(5.0, 0.0, 0.0), 5.0),
        (Pose(-1.0, 0.0, 0.0), 3.0),  # a metre back counts three times
        (Pose(0.0, 2.0, math.pi), math.pi),
        # Three arcs of 60°, of which the least number goes back: the one in the middle.
        (Pose(0.0, 0.0, math.pi), math.pi * (1.0 + 1.0 + 3.0) / 3.0),
    ],
)
def test_a_way_back_counts_more_than_a_way_ahead(goal: Pose, effort: float) -> None:
    assert least_effort(ORIGIN, goal, 1.0, 3.0) == pytest.approx(effort, abs=1e-9)


@unhurried
@given(goal=poses, radius=radii)
def test_where_back_counts_as_ahead_the_easiest_way_is_the_shortest(
    goal: Pose, radius: float
) -> None:
    shortest = shortest_length(ORIGIN, goal, radius)
    assert least_effort(ORIGIN, goal, radius, 1.0) == pytest.approx(shortest, abs=1e-9)
    assert least_effort(ORIGIN, goal, radius, 3.0) >= shortest - 1e-9


def test_the_shortest_way_to_turn_round_on_the_spot_is_three_arcs_of_60_degrees() -> None:
    word = shortest_word(ORIGIN, Pose(0.0, 0.0, math.pi), 3.0)
    assert word.turns[0] == -word.turns[1] == word.turns[2]
    assert [abs(way) for way in word.ways] == pytest.approx([math.pi] * 3 + [0.0] * 2)
    assert word.ways[0] * word.ways[1] < 0.0 < word.ways[0] * word.ways[2]


@unhurried
@given(poses, poses, radii)
def test_every_word_ends_at_the_goal(start: Pose, goal: Pose, radius: float) -> None:
    found = [word_between(number, start, goal, radius) for number in WORDS]
    found = [word for word in found if word.length < math.inf]
    assert found
    for word in found:
        assert gap(pose_along(word, start, word.length + 1.0), goal) < 1e-9
        assert sum(abs(way) for way in word.ways) == pytest.approx(word.length)
    assert shortest_word(start, goal, radius).length == min(word.length for word in found)


@unhurried
@given(poses, poses, radii)
def test_there_and_back_are_as_far_and_so_is_the_mirror_image(
    start: Pose, goal: Pose, radius: float
) -> None:
    length = shortest_length(start, goal, radius)
    assert shortest_length(goal, start, radius) == pytest.approx(length, abs=1e-9)
    mirrored = [pose._replace(y=-pose.y, heading=-pose.heading) for pose in (start, goal)]
    assert shortest_length(*mirrored, radius) == pytest.approx(length, abs=1e-9)
    # A car that faces back from both poses drives the same path in the other gear.
    turned = [pose._replace(heading=pose.heading + math.pi) for pose in (start, goal)]
    assert shortest_length(*turned, radius) == pytest.approx(length, abs=1e-9)


@unhurried
@given(poses, poses, st.floats(0.0, 3.0))
def test_the_cheapest_word_may_be_longer_and_change_its_direction_less(
    start: Pose, goal: Pose, cusp: float
) -> None:
    costs = []
    for number in WORDS:
        word = word_between(number, start, goal, 1.0)
        gears = np.sign([way for way in word.ways if abs(way) > 1e-9])
        costs.append(word.length + cusp * np.count_nonzero(np.diff(gears)))
    # A piece of no length may count as a change, which makes a word cost more than it does.
    assert least_cost(start, goal, 1.0, cusp) >= min(costs) - 1e-9
    assert least_cost(start, goal, 1.0, 0.0) == shortest_length(start, goal, 1.0)


def test_where_changes_of_direction_cost_much_a_car_drives_around_a_block() -> None:
    # Sideways by four radii: an S ahead and the way back cost a change; two half circles do not.
    assert least_cost(ORIGIN, Pose(0.0, 4.0, 0.0), 1.0, 0.0) == pytest.approx(5.4781, abs=5e-5)
    assert least_cost(ORIGIN, Pose(0.0, 4.0, 0.0), 1.0, 9.0) == pytest.approx(2.0 * math.pi)


@unhurried
@given(poses, poses, poses)
def test_a_detour_is_never_shorter(start: Pose, between: Pose, goal: Pose) -> None:
    direct = shortest_length(start, goal, 1.0)
    detour = shortest_length(start, between, 1.0) + shortest_length(between, goal, 1.0)
    assert direct <= detour + 1e-9


@unhurried
@given(poses, poses, radii)
def test_lengths_grow_with_the_plane(start: Pose, goal: Pose, radius: float) -> None:
    larger = [pose._replace(x=radius * pose.x, y=radius * pose.y) for pose in (start, goal)]
    length = shortest_length(start, goal, 1.0)
    assert shortest_length(*larger, radius) == pytest.approx(radius * length)


@unhurried
@given(poses, poses, radii, st.floats(0.0, 1.0))
def test_what_is_left_of_a_shortest_path_is_a_shortest_path(
    start: Pose, goal: Pose, radius: float, share: float
) -> None:
    word = shortest_word(start, goal, radius)
    between = pose_along(word, start, share * word.length)
    left = shortest_length(between, goal, radius)
    # Close to the goal arcs are as long as the square root of what is rounded, 1e-8 and some.
    assert left == pytest.approx((1.0 - share) * word.length, abs=1e-6)


@unhurried
@given(poses, st.floats(-1.0, 1.0), st.floats(-9.0, 9.0))
def test_an_arc_agrees_with_the_integral_of_its_motion(
    pose: Pose, curvature: float, way: float
) -> None:
    end = along_arc(pose, curvature, way)
    turn = curvature * way
    assert end.heading == pytest.approx(pose.heading + turn)
    if abs(curvature) > 1e-3:
        x = pose.x + (math.sin(pose.heading + turn) - math.sin(pose.heading)) / curvature
        y = pose.y - (math.cos(pose.heading + turn) - math.cos(pose.heading)) / curvature
        assert (end.x, end.y) == pytest.approx((x, y), abs=1e-9)
    assert gap(along_arc(end, curvature, -way), pose) < 1e-12


def test_a_pose_one_metre_to_the_left_of_a_car_that_faces_north_lies_west() -> None:
    seen = seen_from(Pose(2.0, 3.0, 0.5 * math.pi), Pose(1.0, 3.0, 0.5 * math.pi))
    assert seen == pytest.approx(Pose(0.0, 1.0, 0.0), abs=1e-12)


def test_lengths_are_those_of_ompl() -> None:
    base = pytest.importorskip(
        "ompl.base", reason="ompl is not installed: `pip install race-server[plan]` brings it"
    )
    space = base.ReedsSheppStateSpace(1.0)
    start, goal = space.allocState(), space.allocState()
    random = np.random.default_rng(3)
    most = 0.0
    for _ in range(2000):
        poses = [Pose(*random.uniform(-6.0, 6.0, 2), random.uniform(-3.14, 3.14)) for _ in "ab"]
        for state, pose in zip((start, goal), poses, strict=True):
            state.setXY(pose.x, pose.y)
            state.setYaw(pose.heading)
        most = max(most, abs(space.distance(start, goal) - shortest_length(*poses, 1.0)))
    assert most < 1e-12
