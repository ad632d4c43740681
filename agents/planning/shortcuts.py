"""Shorter ways of a path: pieces of it replaced by words of Reeds and Shepp, where they are free.

A search joins arcs of a few curvatures and lengths, so that its paths sway around obstacles. Every
turn of the wheels costs time.
"""

import math

import numpy as np

from race_agents.planning.analytic_expansion import (
    LEAST_PIECE,
    NO_WORD,
    cheapest_free_word,
)
from race_agents.planning.path import Path, path_of
from race_server.core.free_space.footprint import Footprint
from race_server.core.free_space.obstacles import Obstacles
from race_server.core.free_space.prices import Prices
from race_server.core.kernels.geometry import Pose
from race_server.core.kernels.reeds_shepp import word_between
from race_server.core.state import Floats

# Pieces of a path begin and end so far apart [m], or farther where there would be more of them.
SPACING, MOST_PIECES = 1.0, 60
# Cost of a change of curvature by that of the tightest turn [m].
TURNING = 1.0
# A shortcut gains at least this [m].
LEAST_GAIN = 0.05


def shortened(
    path: Path, obstacles: Obstacles, footprint: Footprint, prices: Prices, costs: Floats
) -> Path:
    """Return a path as good or better between the same poses.

    costs: (len(WORDS),), work space.
    """
    arcs, first = _cut(path), 0
    while first < len(arcs):
        poses = Path(path.start, arcs).poses
        total = cost_of(arcs, prices, footprint.radius)
        for last in range(len(arcs), first + 1, -1):
            start, end = Pose(*poses[first].tolist()), Pose(*poses[last].tolist())
            replaced = cost_of(arcs[first:last], prices, footprint.radius)
            number, _ = cheapest_free_word(
                obstacles, footprint, start, end, 0.0, replaced, prices, costs
            )
            if number == NO_WORD:
                continue
            word = word_between(number, start, end, footprint.radius)
            pieces = [
                (turn / word.radius, way)
                for turn, way in zip(word.turns, word.ways, strict=True)
                if abs(way) > LEAST_PIECE
            ]
            shorter = np.concatenate([arcs[:first], np.reshape(pieces, (-1, 2)), arcs[last:]])
            if cost_of(shorter, prices, footprint.radius) < total - LEAST_GAIN:
                arcs = shorter
                break
        first += 1
    return path_of(path.start, arcs)


def cost_of(arcs: Floats, prices: Prices, radius: float) -> float:
    """Return what arcs, (A, 2), cost [m]: ways, changes of direction, turns of the wheels.

    radius: of the tightest turn [m].
    """
    ways = arcs[:, 1]
    driven = prices.ahead * ways[ways > 0.0].sum() - prices.back * ways[ways < 0.0].sum()
    changes = np.count_nonzero(np.diff(np.sign(ways)))
    turns = radius * np.abs(np.diff(arcs[:, 0], prepend=0.0)).sum()
    return float(driven + prices.cusp * changes + TURNING * turns)


def _cut(path: Path) -> Floats:
    """Return the arcs of a path in pieces of nearly equal length, (A, 2)."""
    spacing = max(SPACING, path.length / MOST_PIECES)
    pieces = []
    for curvature, way in path.arcs:
        count = math.ceil(abs(way) / spacing)
        pieces += [(curvature, way / count)] * count
    return np.reshape(pieces, (-1, 2))
