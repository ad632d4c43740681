"""Random courses laid from the blocks of `race_server.scenario.track.blocks`."""

import math
from random import Random

import numpy as np

from race_server.scenario.track.blocks import HALF_THICKNESS, TURN_RADIUS, Loop, lay
from race_server.scenario.track.polyline import (
    area_of,
    crossings,
    is_inside,
    nearest_on,
    segments_of,
)
from race_server.scenario.track.skeleton import Corner, draw_path, whole, without_straights

# All lengths are counted in quarters of a metre, so that half a corridor is a whole number.
UNIT = 0.25  # [m]
CELLS = (4, 6)
GAPS = (5, 7)  # between the lines of the grid, in steps of 0.5 m
STEP = 2  # of a border's sides: the half-block
HALF_CORRIDOR = 3  # from the path to the middle of each border
JOG = 4  # two turns against each other move a border by a metre
JOG_AFTER = 14  # least length of a side that may get a jog
MOST_JOGS = 3
SHIFTED = 0.45  # share of the sides of the path at which a border stands out of line

QUARTERS = 4  # turns to one side in a loop, more than to the other
# What a 1/10 car needs: it turns on 0.79 m.
LEAST_WIDTH = 0.89  # [m] free between the borders; blocks give 0.90 at least


def draw_blocks(chance: Random) -> tuple[Loop, Loop, tuple[float, float]]:
    """Return the outer and the inner border of a course and a place [m] on its longest straight."""
    while True:
        path = _with_jogs(chance, _doubled(draw_path(chance, whole(chance, *CELLS), GAPS)))
        if path is None:
            continue
        sides = _borders(chance, path)
        outer, inner = _loop_of("outer", sides[0]), _loop_of("inner", sides[1])
        if outer and inner and is_drivable(outer, inner):
            return outer, inner, _middle_of_longest(path)


def _doubled(path: list[Corner]) -> list[Corner]:
    return [(STEP * x, STEP * y) for x, y in path]


def _with_jogs(chance: Random, path: list[Corner]) -> list[Corner] | None:
    """Return the path with some of its long sides bent twice; None if one meets another."""
    for _ in range(whole(chance, 0, MOST_JOGS)):
        long = [n for n in range(len(path)) if _length(path, n) >= JOG_AFTER]
        if not long:
            break
        side = long[whole(chance, 0, len(long) - 1)]
        path = _with_jog(path, side, JOG if chance.random() < 0.5 else -JOG)
    return path if all(_length(path, n) >= JOG for n in range(len(path))) else None


def _with_jog(path: list[Corner], side: int, shift: int) -> list[Corner]:
    """Return the path with the second half of a side moved by `shift` to its left."""
    (x, y), (x1, y1) = path[side], path[(side + 1) % len(path)]
    east, north = _way(path, side)
    half = STEP * (_length(path, side) // (2 * STEP))
    middle = (x + half * east, y + half * north)
    left = (-shift * north, shift * east)
    bent = list(path)
    bent[(side + 1) % len(path)] = (x1 + left[0], y1 + left[1])
    bent[side + 1 : side + 1] = [middle, (middle[0] + left[0], middle[1] + left[1])]
    return without_straights(bent)


def _borders(chance: Random, path: list[Corner]) -> tuple[list[Corner], list[Corner]]:
    """Return the corners of both borders: beside the path, some sides moved by half a block."""
    outward = [HALF_CORRIDOR] * len(path)
    inward = [HALF_CORRIDOR] * len(path)
    for side in range(len(path)):
        if chance.random() < SHIFTED:
            moved = outward if chance.random() < 0.5 else inward
            moved[side] += STEP if chance.random() < 0.4 else -STEP
    return _beside(path, [-distance for distance in outward]), _beside(path, inward)


def _beside(path: list[Corner], left: list[int]) -> list[Corner]:
    """Return the corners of a path whose sides lie at given distances left of another's."""
    corners = []
    for side, (x, y) in enumerate(path):
        for here in (side - 1, side):
            east, north = _way(path, here % len(path))
            x, y = x - left[here] * north, y + left[here] * east
        corners.append((x, y))
    return corners


def _loop_of(name: str, corners: list[Corner]) -> Loop | None:
    """Return the blocks along a path; None where a side is too short for its turns.

    Or where the path is no loop: sides that were moved over each other make it an eight.
    """
    turn = round(TURN_RADIUS / UNIT)
    words = []
    for side in range(len(corners)):
        straight = _length(corners, side) - 2 * turn
        if straight < 0:
            return None
        words += _straight(straight // STEP)
        (a, b), (c, d) = _way(corners, side), _way(corners, (side + 1) % len(corners))
        words.append("L" if a * d - b * c > 0 else "R")
    if abs(words.count("L") - words.count("R")) != QUARTERS:
        return None
    east, north = _way(corners, 0)
    x, y = corners[0]
    heading = math.atan2(north, east)
    start = (UNIT * (x + turn * east), UNIT * (y + turn * north))
    return Loop(name, *start, heading, " ".join(words))


def _straight(halves: int) -> list[str]:
    metres = [f"{halves // 2}xS" if halves > 3 else "S"] if halves > 1 else []
    return metres + ["H"] * (halves % 2)


def _way(path: list[Corner], side: int) -> Corner:
    (x, y), (x1, y1) = path[side], path[(side + 1) % len(path)]
    return (x1 > x) - (x1 < x), (y1 > y) - (y1 < y)


def _length(path: list[Corner], side: int) -> int:
    (x, y), (x1, y1) = path[side], path[(side + 1) % len(path)]
    return abs(x1 - x) + abs(y1 - y)


def _middle_of_longest(path: list[Corner]) -> tuple[float, float]:
    side = max(range(len(path)), key=lambda n: _length(path, n))
    (x, y), (x1, y1) = path[side], path[(side + 1) % len(path)]
    return 0.5 * UNIT * (x + x1), 0.5 * UNIT * (y + y1)


def is_drivable(outer: Loop, inner: Loop) -> bool:
    """Return whether two borders make a corridor that is wide enough and meets itself nowhere."""
    edges = lay(outer, HALF_THICKNESS), lay(inner, -HALF_THICKNESS)
    if min(area_of(edge) for edge in edges) < 0.0:
        return False
    walls_out, walls_in = (segments_of(edge) for edge in edges)
    if len(crossings(np.concatenate([walls_out, walls_in]))):
        return False
    if not is_inside(edges[1], walls_out).all():
        return False
    gap = min(nearest_on(walls_out, edges[1])[0].min(), nearest_on(walls_in, edges[0])[0].min())
    return bool(gap >= LEAST_WIDTH)
