"""Courses of ours as road networks of highway-env."""

from itertools import pairwise
from typing import Any

import numpy as np

from race_server.scenario.track.course import Course
from race_server.scenario.track.highway_roads import PREFIX, network_of, parts_of

EDGE_M = 40.0  # about the length of an edge


def network_for(course: Course, metres: float) -> Any:
    """Return a road network of a course: its own, if it was imported from one.

    Otherwise one lane as wide as the asphalt, in edges of about 40 m; of a car park one lane as
    large as its ground. metres: there, that are one here.

    Raises:
        ScenarioError: highway-env is not installed.
    """
    if course.name.startswith(PREFIX) and parts_of(course.name)[1] == metres:
        return network_of(parts_of(course.name)[0])
    from highway_env.road.lane import LineType, PolyLane, StraightLane
    from highway_env.road.road import RoadNetwork

    network = RoadNetwork()
    if len(course.line) == 0:
        corners = metres * course.borders.reshape(-1, 2)
        (west, south), (east, north) = corners.min(axis=0), corners.max(axis=0)
        middle_y = 0.5 * (south + north)
        lane = StraightLane([west, middle_y], [east, middle_y], width=north - south)
        network.add_lane("west", "east", lane)
        return network
    left, right = (metres * edge for edge in course.edges())
    middle = 0.5 * (left + right)
    count = max(round(metres * course.length / EDGE_M), 3)
    ends = np.linspace(0, len(middle), count + 1).astype(int)
    step = max(round(1.0 / (metres * course.spacing)), 1)
    for number, (first, last) in enumerate(pairwise(ends)):
        places = [*range(first, last, step), last]
        rows = np.array(places) % len(middle)
        lane = PolyLane(
            middle[rows].tolist(),
            left[rows].tolist(),
            right[rows].tolist(),
            line_types=(LineType.CONTINUOUS, LineType.CONTINUOUS),
        )
        network.add_lane(str(number), str((number + 1) % count), lane)
    return network
