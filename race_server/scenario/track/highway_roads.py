"""Race tracks of highway-env as courses: ``highway:racetrack-v0``.

Its roads are lanes side by side, edge after edge of a graph that closes. A course has the middle of
all lanes as its line, and their outer edges as its borders. ``highway:racetrack-v0:tenth`` is the
same for model cars, ten times smaller.
"""

import re
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from race_server.errors import ScenarioError, TrackError
from race_server.scenario.highway import make_highway
from race_server.scenario.track.course import Floats

PREFIX = "highway:"
TRACKS = ("racetrack-v0", "racetrack-oval-v0", "racetrack-large-v0")
TENTH = 10.0  # metres there that are one metre on a course for model cars

_NAME = re.compile(r"highway:([\w-]+)(:tenth)?")
_STEP = 1.0  # [m] between points
# Edges overlap by up to 1.3 m, or leave as much: their ends are left out, and a spline joins them.
_ENDS = 2.0  # [m]


def parts_of(name: str) -> tuple[str, float]:
    """Return the environment that a course's name stands for, and metres there in one here.

    Raises:
        TrackError: the name is none of these.
    """
    match = _NAME.fullmatch(name)
    if match is None:
        known = ", ".join(PREFIX + track for track in TRACKS)
        raise TrackError(f"track {name!r} is unknown; write {known}, or one of them with :tenth")
    return match[1], TENTH if match[2] else 1.0


def network_of(environment: str) -> Any:
    """Return the road network of an environment.

    Raises:
        ScenarioError: highway-env is not installed, or has no such environment.
    """
    there = make_highway(environment)
    there.reset(seed=0)
    return there.unwrapped.road.network


@cache
def highway_file(name: str) -> bytes:
    """Return the track file of a course's name.

    Raises:
        TrackError: there is no such environment, or its roads make no closed course.
    """
    environment, metres = parts_of(name)
    try:
        points = course_points(loop_of(network_of(environment).graph, environment)) / metres
    except ScenarioError as error:
        raise TrackError(f"track {name!r}: {error}") from error
    rows = [f"    [{', '.join(f'{number:.7f}' for number in row)}]," for row in points]
    scale = "1/10" if metres > 1.0 else "kart"
    head = [
        f"# Lanes of {environment} of highway-env. Points: x, y, half-width left and right [m].",
        f'title = "{environment} of highway-env{", a tenth" if metres > 1.0 else ""}"',
        'form = "line"',
        f'scale = "{scale}"',
        "points = [",
    ]
    return "\n".join([*head, *rows, "]", ""]).encode()


def loop_of(graph: Any, environment: str) -> list[Sequence[Any]]:
    """Return the lanes of each edge, once around.

    graph: of a road network, from node to node to lanes.

    Raises:
        TrackError: the roads are no single loop.
    """
    begin = node = next(iter(graph))
    edges = []
    for _ in graph:
        following = list(graph.get(node, {}))
        if len(following) != 1:
            break
        edges.append(graph[node][following[0]])
        node = following[0]
        if node == begin and len(edges) == len(graph):
            return edges
    raise TrackError(
        f"{environment}: its roads are no single loop; choose one of {', '.join(TRACKS)}"
    )


def course_points(edges: Sequence[Sequence[Any]]) -> Floats:
    """Return the middle of the lanes of each edge with half their width: (N, 4) [m]."""
    rows: list[Floats] = []
    for lanes in edges:
        left = max(lanes, key=lambda lane: _aside(lane, lanes[0]))
        right = min(lanes, key=lambda lane: _aside(lane, lanes[0]))
        length = 0.5 * (left.length + right.length)
        ends = min(_ENDS, 0.25 * length)
        steps = max(round((length - 2.0 * ends) / _STEP), 2)
        for share in np.linspace(ends / length, 1.0 - ends / length, steps + 1):
            outer = _edge(left, share, 0.5)
            inner = _edge(right, share, -0.5)
            half = 0.5 * float(np.hypot(*(outer - inner)))
            rows.append(np.array([*(0.5 * (outer + inner)), half, half]))
    return np.array(rows)


def _aside(lane: Any, other: Any) -> float:
    """Return how far to the left [m] of another lane the middle of a lane is."""
    return float(other.local_coordinates(lane.position(0.5 * lane.length, 0.0))[1])


def _edge(lane: Any, share: float, side: float) -> Floats:
    """Return a point of a lane's edge. side: 0.5 for the left one, -0.5 for the right one."""
    along = share * lane.length
    return np.asarray(lane.position(along, side * lane.width_at(along)), np.float64)
