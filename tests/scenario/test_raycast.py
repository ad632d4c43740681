"""Lines of sight: numbers that can be checked in the head."""

import math

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from race_server.scenario.track.polyline import corners_of_box, segments_of
from race_server.scenario.track.raycast import are_near, first_met

ROOM = segments_of(corners_of_box(0.0, 0.0, 0.0, 6.0, 4.0))  # 3 m ahead, 2 m to each side


def test_in_a_room_each_ray_ends_at_the_wall_that_it_points_at() -> None:
    angles = np.array([0.0, math.pi / 2, math.pi, -math.pi / 2, math.atan2(2.0, 3.0) / 2])
    ranges, which = first_met(ROOM, 0.0, 0.0, angles, 10.0)
    assert np.allclose(ranges[:4], [3.0, 2.0, 3.0, 2.0])
    assert len(set(which[:4])) == 4
    assert which[4] == which[0]


def test_of_two_walls_the_nearer_one_is_seen_and_beyond_reach_none() -> None:
    walls = np.array([[5.0, -1.0, 5.0, 1.0], [4.0, -1.0, 4.0, 1.0]])
    assert [float(found[0]) for found in first_met(walls, 0.0, 0.0, np.zeros(1), 8.0)] == [4.0, 1.0]
    assert [float(found[0]) for found in first_met(walls, 0.0, 0.0, np.zeros(1), 3.0)] == [3.0, -1]


def test_a_ray_along_a_wall_does_not_meet_it() -> None:
    ranges, which = first_met(np.array([[1.0, 0.0, 2.0, 0.0]]), 0.0, 0.0, np.zeros(1), 8.0)
    assert (float(ranges[0]), int(which[0])) == (8.0, -1)


@given(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0), st.floats(0.1, 9.0), st.floats(-3.2, 3.2))
def test_what_is_not_near_is_never_met(x: float, y: float, reach: float, angle: float) -> None:
    far = ROOM[~are_near(ROOM, x, y, reach)]
    assert (first_met(far, x, y, np.array([angle]), reach)[1] == -1).all()
