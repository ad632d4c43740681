"""The rest of a path as one word of Reeds and Shepp, if one of them is free."""

import math

from race_server.core.free_space.footprint import Footprint
from race_server.core.free_space.obstacles import Obstacles, free_way
from race_server.core.free_space.prices import Prices, cost_of_way
from race_server.core.kernels.geometry import Pose, along_arc
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.reeds_shepp import PIECES, WORDS, Word, word_between
from race_server.core.state import Floats

# A shorter piece is no piece [m].
LEAST_PIECE = 1e-6
NO_WORD = -1


@kernel
def cost_of_word(word: Word, direction: float, prices: Prices) -> float:
    """Return the cost [m] of a word; direction: in which the vehicle came, 0 if it stands."""
    cost = 0.0
    for piece in range(PIECES):
        way = word.ways[piece]
        if abs(way) > LEAST_PIECE:
            if way * direction < 0.0:
                cost += prices.cusp
            direction = way
            cost += cost_of_way(way, prices)
    return cost


@kernel
def word_is_free(obstacles: Obstacles, footprint: Footprint, start: Pose, word: Word) -> bool:
    """Return whether the vehicle can drive a word."""
    pose = start
    for piece in range(PIECES):
        way, curvature = word.ways[piece], word.turns[piece] / word.radius
        if abs(way) > LEAST_PIECE and free_way(obstacles, footprint, pose, curvature, way) != way:
            return False
        pose = along_arc(pose, curvature, way)
    return True


@large_kernel
def cheapest_free_word(
    obstacles: Obstacles,
    footprint: Footprint,
    start: Pose,
    goal: Pose,
    direction: float,
    most: float,
    prices: Prices,
    costs: Floats,
) -> tuple[int, float]:
    """Return number and cost [m] of the cheapest word that is free, NO_WORD if none is.

    direction: in which the vehicle came, 0 if it stands; most: the word must cost less [m]; costs:
    (len(WORDS),), work space.
    """
    for place, number in enumerate(WORDS):
        word = word_between(number, start, goal, footprint.radius)
        costs[place] = cost_of_word(word, direction, prices)
    while True:
        best = 0
        for place in range(len(costs)):
            if costs[place] < costs[best]:
                best = place
        cost = costs[best]
        if cost >= most:
            return NO_WORD, math.inf
        costs[best] = math.inf
        number = WORDS[best]
        word = word_between(number, start, goal, footprint.radius)
        if word_is_free(obstacles, footprint, start, word):
            return number, cost
