"""Shortest paths of a car that drives forward and back, with a least turning radius.

Reeds and Shepp, Optimal paths for a car that goes both forwards and backwards, Pacific Journal of
Mathematics 145(2), 1990: a shortest path is one of 48 words of at most five pieces, each an arc of
the least radius or straight. Their formulas (8.1) to (8.11) give eight kinds of words that begin
with a left turn ahead. The others follow by driving the same turns the other way (x and heading
change their signs), by a mirror (y and heading change theirs), and from the goal to the start.
(8.3) and (8.4) are one kind here, whose last arc goes either way: so 44 numbers stand for 48 words.

Lengths are in radii until a word is complete; poses are those of the rear axle.
"""

import math
from typing import NamedTuple

from race_server.core.kernels.geometry import Pose, along_arc, cos_sin, seen_from, wrap_angle
from race_server.core.kernels.jit import kernel, large_kernel

LEFT, STRAIGHT, RIGHT = 1, 0, -1
PIECES = 5

# The kinds: turns, | where the direction of travel changes; in brackets their formula.
LSL, LSR, LRL, LR_LR, L_RL_R, L_RSL, L_RSR, L_RSL_R = range(8)
# Bits of a word's number below its kind.
TURNED, MIRRORED, SWAPPED = 1, 2, 4
# All words. Swapped, the other kinds are words of the same kind.
WORDS = tuple(
    8 * kind + bits for kind in range(8) for bits in range(8 if kind in (LRL, L_RSL, L_RSR) else 4)
)

# An arc that should go ahead may go back by rounding, by less than this [rad].
SLACK = 1e-10
QUARTER = 0.5 * math.pi


class Pieces(NamedTuple):
    """The three numbers [radii] that a kind of words leaves open; the first is infinite if none."""

    first: float
    middle: float
    last: float


class Word(NamedTuple):
    """A path of at most five pieces."""

    turns: tuple[int, int, int, int, int]  # LEFT, STRAIGHT or RIGHT
    ways: tuple[float, float, float, float, float]  # [m], negative in reverse, 0 of no piece
    length: float  # [m] of all pieces; infinite if there is no such path
    radius: float  # [m]


NONE = Pieces(math.inf, 0.0, 0.0)


@kernel
def _ahead(angle: float) -> float:
    """Return an angle moved by whole turns into about [-pi, pi], where pi itself goes ahead."""
    wrapped = wrap_angle(angle)
    return wrapped + 2.0 * math.pi if wrapped < SLACK - math.pi else wrapped


@kernel
def _back(angle: float) -> float:
    """Return an angle moved by whole turns into about [-pi, pi], where -pi goes back."""
    return -_ahead(-angle)


@kernel
def _outer_arcs(goal: Pose, x: float, y: float, second: float, third: float) -> tuple[float, float]:
    """Return the first and the last arc of a word of four, whose middle ones are given.

    x, y: from the centre of the first circle to that of the last one.
    """
    cos2, sin2 = cos_sin(second)
    cos3, _ = cos_sin(third)
    turn = wrap_angle(second - third)
    cos, sin = cos_sin(turn)
    a, b = sin2 - sin, cos2 - cos - 1.0
    first = math.atan2(y * a - x * b, x * a + y * b)
    if 2.0 * (cos - cos3 - cos2) + 3.0 < 0.0:
        first += math.pi
    return first, first - second + third - goal.heading


@kernel
def _same_side(kind: int, goal: Pose, x: float, y: float) -> Pieces:
    """Return the words that end on a left turn, or NONE; x, y: between the two circles' centres."""
    if kind == LRL:  # (8.3), (8.4)
        apart = math.sqrt(x * x + y * y)
        if apart > 4.0:
            return NONE
        middle = -2.0 * math.asin(0.25 * apart)
        first = _ahead(math.atan2(y, x) + 0.5 * middle + math.pi)
        last = wrap_angle(goal.heading - first + middle)
        return Pieces(first, middle, last) if first > -SLACK else NONE
    if kind == LSL:  # (8.1)
        first = _ahead(math.atan2(y, x))
        last = _ahead(goal.heading - first)
        if first > -SLACK and last > -SLACK:
            return Pieces(first, math.sqrt(x * x + y * y), last)
        return NONE
    square = x * x + y * y  # (8.9)
    if square < 4.0:
        return NONE
    way = math.sqrt(square - 4.0)
    first = _ahead(math.atan2(y, x) + math.atan2(way, -2.0))
    last = _back(goal.heading - QUARTER - first)
    if first > -SLACK and 2.0 - way < SLACK and last < SLACK:
        return Pieces(first, 2.0 - way, last)
    return NONE


@kernel
def _four_arcs(kind: int, goal: Pose, x: float, y: float) -> Pieces:
    """Return the words of four arcs, or NONE; x, y: between the two outer circles' centres."""
    square = x * x + y * y
    if kind == LR_LR:  # (8.7)
        cosine = 0.25 * (2.0 + math.sqrt(square))
        if cosine > 1.0:
            return NONE
        middle = math.acos(cosine)
        first, last = _outer_arcs(goal, x, y, middle, -middle)
        first, last = _ahead(first), _back(last)
        return Pieces(first, middle, last) if first > -SLACK and last < SLACK else NONE
    cosine = 0.0625 * (20.0 - square)  # (8.8)
    if cosine < 0.0 or cosine > 1.0:
        return NONE
    middle = -math.acos(cosine)
    first, last = _outer_arcs(goal, x, y, middle, middle)
    first, last = _ahead(first), _ahead(last)
    return Pieces(first, middle, last) if first > -SLACK and last > -SLACK else NONE


@kernel
def _other_side(kind: int, goal: Pose, x: float, y: float) -> Pieces:
    """Return the words that end on a right turn, or NONE; x, y: between the circles' centres."""
    if kind in (LR_LR, L_RL_R):
        return _four_arcs(kind, goal, x, y)
    square = x * x + y * y
    if square < 4.0:
        return NONE
    if kind == L_RSR:  # (8.10)
        apart = math.sqrt(square)
        first = _ahead(math.atan2(x, -y))
        last = _back(first + QUARTER - goal.heading)
        if first > -SLACK and 2.0 - apart < SLACK and last < SLACK:
            return Pieces(first, 2.0 - apart, last)
        return NONE
    way = math.sqrt(square - 4.0)
    if kind == LSR:  # (8.2)
        middle = way
        first = _ahead(math.atan2(y, x) + math.atan2(2.0, way))
    else:  # (8.11)
        middle = 4.0 - way
        if middle > SLACK:
            return NONE
        first = _ahead(math.atan2(way * x - 2.0 * y, -2.0 * x - way * y))
    last = _ahead(first - goal.heading)
    return Pieces(first, middle, last) if first > -SLACK and last > -SLACK else NONE


@large_kernel
def _pieces(number: int, goal: Pose, cos: float, sin: float) -> Pieces:
    """Return the open numbers of a word that leads to a pose from the origin.

    goal: in radii; cos, sin: of its heading.
    """
    x, y, heading = goal.x, goal.y, goal.heading
    if number & SWAPPED:
        x, y = x * cos + y * sin, x * sin - y * cos
    if number & TURNED:
        x, heading, sin = -x, -heading, -sin
    if number & MIRRORED:
        y, heading, sin = -y, -heading, -sin
    kind, seen = number >> 3, Pose(x, y, heading)
    # From the centre of the first circle, (0, 1), to that of the last one.
    if kind in (LSL, LRL, L_RSL):
        return _same_side(kind, seen, x - sin, y - 1.0 + cos)
    return _other_side(kind, seen, x + sin, y - 1.0 - cos)


@kernel
def _length(number: int, pieces: Pieces) -> float:
    """Return the length [radii] of a word; infinite if there is none."""
    kind = number >> 3
    length = abs(pieces.first) + abs(pieces.middle) + abs(pieces.last)
    if kind in (LR_LR, L_RL_R):
        length += abs(pieces.middle)
    elif kind in (L_RSL, L_RSR):
        length += QUARTER
    elif kind == L_RSL_R:
        length += math.pi
    return length


@kernel
def _changes(number: int, pieces: Pieces) -> int:
    """Return how often a word changes its direction of travel."""
    kind = number >> 3
    if kind in (LSL, LSR):
        return 0
    if kind == LRL:
        return 2 if pieces.last > 0.0 else 1
    return 2 if kind in (L_RL_R, L_RSL_R) else 1


@large_kernel
def _cheapest(goal: Pose, cusp: float) -> tuple[int, float]:
    """Return number and cost [radii] of the cheapest word from the origin to a pose in radii.

    cusp: cost of a change of direction [radii].
    """
    cos, sin = cos_sin(goal.heading)
    best, least = 0, math.inf
    for number in WORDS:
        pieces = _pieces(number, goal, cos, sin)
        cost = _length(number, pieces) + cusp * _changes(number, pieces)
        if cost < least:
            best, least = number, cost
    return best, least


@kernel
def _in_radii(start: Pose, goal: Pose, radius: float) -> Pose:
    seen = seen_from(start, goal)
    return Pose(seen.x / radius, seen.y / radius, seen.heading)


@kernel
def _spelled(number: int, pieces: Pieces, radius: float) -> Word:
    """Return the word that a number and its open numbers stand for."""
    kind, (a, m, z) = number >> 3, pieces
    turns, ways = (LEFT, STRAIGHT, LEFT, 0, 0), (a, m, z, 0.0, 0.0)
    if kind == LSR:
        turns = (LEFT, STRAIGHT, RIGHT, 0, 0)
    elif kind == LRL:
        turns = (LEFT, RIGHT, LEFT, 0, 0)
    elif kind == LR_LR:
        turns, ways = (LEFT, RIGHT, LEFT, RIGHT, 0), (a, m, -m, z, 0.0)
    elif kind == L_RL_R:
        turns, ways = (LEFT, RIGHT, LEFT, RIGHT, 0), (a, m, m, z, 0.0)
    elif kind == L_RSL:
        turns, ways = (LEFT, RIGHT, STRAIGHT, LEFT, 0), (a, -QUARTER, m, z, 0.0)
    elif kind == L_RSR:
        turns, ways = (LEFT, RIGHT, STRAIGHT, RIGHT, 0), (a, -QUARTER, m, z, 0.0)
    elif kind == L_RSL_R:
        turns = (LEFT, RIGHT, STRAIGHT, LEFT, RIGHT)
        ways = (a, -QUARTER, m, -QUARTER, z)
    if number & SWAPPED:
        turns = (turns[4], turns[3], turns[2], turns[1], turns[0])
        ways = (ways[4], ways[3], ways[2], ways[1], ways[0])
    side = RIGHT if number & MIRRORED else LEFT
    scale = -radius if number & TURNED else radius
    return Word(
        (side * turns[0], side * turns[1], side * turns[2], side * turns[3], side * turns[4]),
        (scale * ways[0], scale * ways[1], scale * ways[2], scale * ways[3], scale * ways[4]),
        radius * _length(number, pieces),
        radius,
    )


@large_kernel
def word_between(number: int, start: Pose, goal: Pose, radius: float) -> Word:
    """Return a word between two poses; its length is infinite if it does not lead there.

    number: one of `WORDS`; radius: least turning radius [m].
    """
    seen = _in_radii(start, goal, radius)
    cos, sin = cos_sin(seen.heading)
    return _spelled(number, _pieces(number, seen, cos, sin), radius)


@large_kernel
def shortest_word(start: Pose, goal: Pose, radius: float) -> Word:
    """Return the shortest word between two poses, the first of `WORDS` where several are.

    radius: least turning radius [m].
    """
    number, _ = _cheapest(_in_radii(start, goal, radius), 0.0)
    return word_between(number, start, goal, radius)


@large_kernel
def shortest_length(start: Pose, goal: Pose, radius: float) -> float:
    """Return the length [m] of the shortest path between two poses; radius: the least [m]."""
    _, length = _cheapest(_in_radii(start, goal, radius), 0.0)
    return radius * length


@large_kernel
def least_cost(start: Pose, goal: Pose, radius: float, cusp: float) -> float:
    """Return the cost [m] of the cheapest word whose changes of direction cost something.

    radius: least turning radius [m]; cusp: cost of a change of direction [m]. It is an estimate and
    no bound: a turn of more than half a circle is no word's, and may be cheaper; so may be a
    single arc at full lock, of whose words rounding leaves one with changes.
    """
    _, cost = _cheapest(_in_radii(start, goal, radius), cusp / radius)
    return radius * cost


@kernel
def _effort(number: int, pieces: Pieces, reverse: float) -> float:
    """Return the length [radii] of a word whose ways back count `reverse` times."""
    kind, (a, m, z) = number >> 3, pieces
    if a == math.inf:
        return math.inf
    ahead, back = max(a, 0.0) + max(z, 0.0), max(-a, 0.0) + max(-z, 0.0)
    ahead, back = ahead + max(m, 0.0), back + max(-m, 0.0)
    if kind == LR_LR:  # its arcs in the middle are m and -m
        ahead, back = ahead + max(-m, 0.0), back + max(m, 0.0)
    elif kind == L_RL_R:
        ahead, back = ahead + max(m, 0.0), back + max(-m, 0.0)
    elif kind in (L_RSL, L_RSR):
        back += QUARTER
    elif kind == L_RSL_R:
        back += math.pi
    return back + reverse * ahead if number & TURNED else ahead + reverse * back


@large_kernel
def least_effort(start: Pose, goal: Pose, radius: float, reverse: float) -> float:
    """Return the length [m] of the easiest of the words between two poses.

    radius: least turning radius [m]; reverse: how often a metre driven back counts, at least 1.
    """
    seen = _in_radii(start, goal, radius)
    cos, sin = cos_sin(seen.heading)
    least = math.inf
    for number in WORDS:
        least = min(least, _effort(number, _pieces(number, seen, cos, sin), reverse))
    return radius * least


@large_kernel
def pose_along(word: Word, start: Pose, distance: float) -> Pose:
    """Return the pose after a distance [m] on a word, at most at its end; headings not wrapped."""
    pose = start
    for piece in range(PIECES):
        way = word.ways[piece]
        if distance <= 0.0:
            break
        if abs(way) > distance:
            way = math.copysign(distance, way)
        distance -= abs(way)
        pose = along_arc(pose, word.turns[piece] / word.radius, way)
    return pose
