"""Echoes that others confirm, so that stray ones are no objects.

An echo counts once another one confirms it: of an earlier scan, from where it must have come by
its closing speed, or of the same thing beside it.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.ego import Ego
from race_agents.unit.safety import Echoes
from race_agents.unit.track import GATE, Track
from race_server.core import codes

Floats = NDArray[np.float64]

# An echo and what confirms it lie within this [m] of each other, with closing speeds [m/s] within
# that.
NEAR, ALIKE = 0.7, 2.0
# Echoes beside it, of the same scan, that confirm one as well.
BESIDE = 2
# A place is seen through where an echo came from this much [m] behind it, at a bearing [rad] this
# near. Where it was in this number of scans nothing stands yet: two scans have to say that it does.
BEHIND, SAME, CLEAR = 1.0, 0.025, 2
# A border goes on between two echoes of it in neighbouring directions, this near [rad]; what lies
# this near [m] to the line between them may be the border.
NEIGHBOURS, BESIDE_LINE = 0.16, 0.3


class Scan(NamedTuple):
    """An earlier scan, in the kart's frame of now, and from where it was made."""

    echoes: Echoes
    x: float  # [m]
    y: float  # [m]


def moved(echoes: Echoes, ego: Ego, dt: float) -> Echoes:
    """Return where echoes are a scan later: nearer by their closing speed, turned by the kart."""
    far = np.maximum(np.hypot(echoes.x, echoes.y), 1e-6)
    nearer = np.maximum(1.0 - echoes.closing * dt / far, 0.0)
    # The kart's own way across the ray is no part of the closing speed.
    cos, sin = echoes.x / far, echoes.y / far
    drift = -ego.ahead * sin + ego.left * cos
    x, y = echoes.x * nearer + drift * sin, echoes.y * nearer - drift * cos
    turn_cos, turn_sin = math.cos(ego.turned), math.sin(ego.turned)
    return Echoes(
        turn_cos * x + turn_sin * y, turn_cos * y - turn_sin * x, echoes.closing, echoes.kinds
    )


def carried(scan: Scan, ego: Ego, dt: float) -> Scan:
    """Return an earlier scan in the kart's frame of a scan later."""
    x, y = scan.x - ego.ahead, scan.y - ego.left
    cos, sin = math.cos(ego.turned), math.sin(ego.turned)
    return Scan(moved(scan.echoes, ego, dt), cos * x + sin * y, cos * y - sin * x)


def confirmed(echoes: Echoes, earlier: Sequence[Scan], tracks: Sequence[Track] = ()) -> Echoes:
    """Return those echoes that others confirm. tracks: where something is known to be.

    One whose kind few others confirm is of the kind of those that lie around it.
    """
    if len(echoes.x) == 0:
        return echoes
    beside = are_near(echoes, echoes)
    beside.reshape(-1)[:: len(echoes.x) + 1] = False  # none lies beside itself
    is_thing = echoes.kinds != codes.BORDER
    votes = np.zeros((2, len(echoes.x)), np.int64)  # for a border, for a thing
    times = np.zeros(len(echoes.x), np.int64)
    before = [scan.echoes for scan in earlier]
    nears = [are_near(echoes, scan) for scan in before]
    for near, scan in zip(nears, before, strict=True):
        thing = scan.kinds != codes.BORDER
        times += near.any(axis=1)
        votes[1] += (near & thing).any(axis=1)
        votes[0] += (near & ~thing).any(axis=1) & ~(near & thing).any(axis=1)
    around = np.stack([(beside & ~is_thing).sum(axis=1), (beside & is_thing).sum(axis=1)])
    if is_thing.any():
        around[0] += _lies_on_border(echoes)
    kept = (times >= 1) | (beside.sum(axis=1) >= BESIDE)
    appears = times <= 1
    if appears.any():
        appears[appears] = _seen_through(echoes.kept(appears), earlier) >= CLEAR
    for track in tracks if appears.any() else ():
        is_like = (echoes.kinds == codes.KART_HIT) == (track.kind == codes.KART_HIT)
        near = np.hypot(echoes.x - track.state[0], echoes.y - track.state[1]) < GATE
        appears &= ~(is_like & near)
    kept &= ~appears
    for_border, for_thing = votes + around
    # What nothing else takes for a thing lies on a border, or is a stray; where anything takes it
    # for a border, two others have to.
    least = np.where(for_border > 0, np.maximum(for_border, 2), 1)
    doubtful = is_thing & (for_thing < least)
    kinds = np.where(doubtful, codes.BORDER, _outvoted(echoes, before, nears, beside)).astype(
        np.uint8
    )
    return Echoes(echoes.x, echoes.y, echoes.closing, kinds).kept(kept)


def _seen_through(echoes: Echoes, earlier: Sequence[Scan]) -> NDArray[np.int64]:
    """Return in how many earlier scans the radar saw something behind the places of echoes (n,).

    No person appears where it just saw the ground behind; a mirrored or a stray echo does. Each
    scan saw from where the radar was then: what is near lies elsewhere in the view by now.
    """
    through = np.zeros(len(echoes.x), np.int64)
    for scan, x, y in earlier:
        far, ways = _view(echoes, x, y)
        theirs, bearings = _view(scan, x, y)
        off = np.abs(bearings - ways[:, None])
        through += ((off < SAME) & (theirs > far[:, None] + BEHIND)).any(axis=1)
    return through


def _lies_on_border(echoes: Echoes) -> NDArray[np.bool_]:
    """Return which echoes lie on the line between two echoes of a border beside them, (n,).

    Along a border that is seen at a flat angle its echoes lie metres apart.
    """
    found = np.zeros(len(echoes.x), np.bool_)
    ways = np.arctan2(echoes.y, echoes.x)
    border = np.flatnonzero(echoes.kinds == codes.BORDER)
    border = border[np.argsort(ways[border])]
    things = np.flatnonzero(echoes.kinds != codes.BORDER)
    after = np.searchsorted(ways[border], ways[things])
    is_between = (after > 0) & (after < len(border))
    things, after = things[is_between], after[is_between]
    first, last = border[after - 1], border[after]
    x0, y0 = echoes.x[first], echoes.y[first]
    dx, dy = echoes.x[last] - x0, echoes.y[last] - y0
    off = (echoes.x[things] - x0) * dy - (echoes.y[things] - y0) * dx
    is_on = np.abs(off) < BESIDE_LINE * np.maximum(np.hypot(dx, dy), 1e-6)
    found[things] = is_on & (ways[last] - ways[first] < NEIGHBOURS)
    return found


def _view(echoes: Echoes, x: float, y: float) -> tuple[Floats, Floats]:
    """Return how far [m] and in which direction [rad] echoes lie from a place, (n,) each."""
    return np.hypot(echoes.x - x, echoes.y - y), np.arctan2(echoes.y - y, echoes.x - x)


def _outvoted(
    echoes: Echoes,
    earlier: Sequence[Echoes],
    nears: Sequence[NDArray[np.bool_]],
    beside: NDArray[np.bool_],
) -> NDArray[np.uint8]:
    """Return kinds (n,): a kart among people, or a person among karts, is one of the others.

    What was taken for a person before, too, is one: a child who comes from behind a kart.

    nears: which echoes (n,) lie near which of each earlier scan; beside: … of this one.
    """
    if not (echoes.kinds != codes.BORDER).any():
        return echoes.kinds
    kart, other = echoes.kinds == codes.KART_HIT, echoes.may_be_people
    karts = (beside & kart).sum(axis=1)
    others, before = (beside & other).sum(axis=1), np.zeros(len(kart), np.int64)
    for near, scan in zip(nears, earlier, strict=True):
        karts = karts + (near & (scan.kinds == codes.KART_HIT)).sum(axis=1)
        before = before + (near & scan.may_be_people).sum(axis=1)
    others = others + before
    # Without any other of its kind one among karts is enough: a stray echo is confirmed by those.
    is_alone = other & (before == 0) & (karts > np.where(others == 0, 0, others + 1))
    kinds = np.where(is_alone, codes.KART_HIT, echoes.kinds)
    return np.where(kart & (others > karts + 1), codes.OBSTACLE, kinds).astype(np.uint8)


def are_near(one: Echoes, other: Echoes) -> NDArray[np.bool_]:
    """Return which pairs may be of one thing, shape (n, m)."""
    dx, dy = one.x[:, None] - other.x, one.y[:, None] - other.y
    alike = np.abs(one.closing[:, None] - other.closing) < ALIKE
    return np.asarray((dx * dx + dy * dy < NEAR * NEAR) & alike)
