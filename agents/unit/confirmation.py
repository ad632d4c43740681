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
from race_server.core.messages import RayHit

Floats = NDArray[np.float64]

SCANS = 3  # earlier ones that may confirm an echo
# What echoes may be of, as far as others confirm it: a kart and people are things as well.
BORDER, THING, KART, PEOPLE = range(4)
IS_OF = np.zeros((1 + max(RayHit), 4), np.float32)  # (kinds, classes)
IS_OF[:, THING] = 1.0
IS_OF[codes.BORDER] = 1.0, 0.0, 0.0, 0.0
IS_OF[codes.KART_HIT, KART] = IS_OF[[codes.OBSTACLE, codes.PERSON], PEOPLE] = 1.0
# An echo and what confirms it lie within this [m] of each other, with closing speeds [m/s] within
# that.
NEAR, ALIKE = 0.7, 2.0
# Echoes beside it, of the same scan, that confirm one as well.
BESIDE = 2
# A lone echo where nothing is known to be is confirmed by the very last scan. One that would be met
# sooner than this [s] has to be confirmed twice: what is there was seen farther away before, and it
# is too late for brakes.
SUDDEN_S = 0.15
# A person among this many times as many echoes of a kart is a part of it.
CONFUSED = 10.0
# A place is seen through where an echo came from this much [m] behind it, at a bearing [rad] this
# near. Where it was in this number of scans nothing stands yet: two scans have to say that it does.
BEHIND, SAME, CLEAR = 1.0, 0.025, 2
# A border goes on between two echoes of it in neighbouring directions, this near [rad]; what lies
# this near [m] to the line between them may be the border.
NEIGHBOURS, BESIDE_LINE = 0.16, 0.3
# A border goes on beyond two echoes of it: so far [m] from the farther one, or from the nearer one
# as many times as far as they lie apart.
GOES_ON, AS_FAR = 2.0, 3.0


class Past(NamedTuple):
    """The echoes of earlier scans, in the kart's frame of now."""

    echoes: Echoes  # (m,)
    x: Floats  # (m,) [m] where the radar was when it saw each
    y: Floats  # (m,) [m]
    ago: NDArray[np.int64]  # (m,) scans since then

    @classmethod
    def nothing(cls) -> "Past":
        """Return what was seen before the first scan."""
        none = np.zeros(0)
        return cls(Echoes.nothing(), none, none, np.zeros(0, np.int64))

    def carried(self, ego: Ego, dt: float, radar: float) -> "Past":
        """Return them in the kart's frame of a scan later, but for those that are too old."""
        kept = self.ago < SCANS
        x, y = self.x[kept] - ego.ahead, self.y[kept] - ego.left
        cos, sin = math.cos(ego.turned), math.sin(ego.turned)
        echoes = moved(self.echoes.kept(kept), ego, dt, radar)
        return Past(echoes, cos * x + sin * y, cos * y - sin * x, self.ago[kept] + 1)

    def with_scan(self, echoes: Echoes, radar: float) -> "Past":
        """Return them with a scan of now. radar: [m] that the radar is ahead of the rear axle."""
        here = np.full(len(echoes.x), radar)
        return Past(
            self.echoes.joined(echoes),
            np.concatenate([self.x, here]),
            np.concatenate([self.y, np.zeros(len(here))]),
            np.concatenate([self.ago, np.zeros(len(here), np.int64)]),
        )


def moved(echoes: Echoes, ego: Ego, dt: float, radar: float) -> Echoes:
    """Return where echoes are a scan later: nearer by their closing speed, turned by the kart.

    radar: [m] that the radar is ahead of the rear axle; it swings aside as the kart turns.
    """
    ahead = echoes.x - radar
    far = np.maximum(np.hypot(ahead, echoes.y), 1e-6)
    nearer = np.maximum(1.0 - echoes.closing * dt / far, 0.0)
    # The radar's own way across the ray is no part of the closing speed.
    cos, sin = ahead / far, echoes.y / far
    turn_cos, turn_sin = math.cos(ego.turned), math.sin(ego.turned)
    way, swing = ego.ahead + radar * (turn_cos - 1.0), ego.left + radar * turn_sin
    drift = swing * cos - way * sin
    x, y = ahead * nearer + drift * sin, echoes.y * nearer - drift * cos
    return Echoes(
        turn_cos * x + turn_sin * y + radar,
        turn_cos * y - turn_sin * x,
        echoes.closing,
        echoes.kinds,
    )


def confirmed(
    echoes: Echoes, past: Past, tracks: Sequence[Track] = (), radar: float = 0.0
) -> Echoes:
    """Return those echoes that others confirm.

    tracks: where something is known to be; radar: [m] that the radar is ahead of the rear axle. One
    whose kind few others confirm is of the kind of those that lie around it.
    """
    if len(echoes.x) == 0:
        return echoes
    near = _count_near(echoes, past)
    here, before = near[:, 0], near[:, 1:]
    is_thing = echoes.kinds != codes.BORDER
    # In how many earlier scans each was there, and what it was: votes for a border, for a thing.
    was = before[:, :, : THING + 1] > 0.0
    was_border, was_thing = was[:, :, BORDER], was[:, :, THING]
    times = (was_border | was_thing).sum(axis=1)
    kept = (times >= 1) | (here[:, BORDER] + here[:, THING] >= BESIDE)
    known = are_tracked(echoes, tracks)
    kept &= known | ~_appears(echoes, times, past)
    if not is_thing.any():
        return echoes.kept(kept)
    for_thing = was_thing.sum(axis=1) + here[:, THING]
    ahead = Echoes(echoes.x - radar, echoes.y, echoes.closing, echoes.kinds)
    for_border = (was_border & ~was_thing).sum(axis=1) + here[:, BORDER] + _lies_on_border(ahead)
    lone = is_thing & (for_border == 0.0) & (for_thing == 1.0)
    if lone.any():
        for_border += _continues_border(ahead, lone)
        is_sudden = np.hypot(ahead.x, ahead.y) < SUDDEN_S * echoes.closing
        kept &= known | ~(lone & (is_sudden | ~was_thing[:, 0]))
    # What nothing else takes for a thing lies on a border, or is a stray; where anything takes it
    # for a border, two others have to, and more at first.
    least = np.where(for_border > 0.0, np.maximum(for_border, 2.0), 1.0)
    is_new = ~was_thing.any(axis=1) & (for_thing <= for_border)
    doubtful = is_thing & (is_new | (for_thing < least))
    kinds = np.where(doubtful, codes.BORDER, _outvoted(echoes, here, before.sum(axis=1)))
    return Echoes(echoes.x, echoes.y, echoes.closing, kinds.astype(np.uint8)).kept(kept)


def _count_near(echoes: Echoes, past: Past) -> NDArray[np.float32]:
    """Return how many echoes lie near each, by scans ago and by class, shape (n, 1 + SCANS, 4)."""
    everything = echoes.joined(past.echoes)
    near = are_near(echoes, everything)
    np.fill_diagonal(near, val=False)  # none lies beside itself
    ago = np.concatenate([np.zeros(len(echoes.x), np.int64), past.ago])
    belongs = np.zeros((len(ago), 1 + SCANS, 4), np.float32)
    belongs[np.arange(len(ago)), ago] = IS_OF[everything.kinds]
    counts = near.astype(np.float32) @ belongs.reshape(len(ago), -1)
    return counts.reshape(-1, 1 + SCANS, 4)


def are_tracked(echoes: Echoes, tracks: Sequence[Track]) -> NDArray[np.bool_]:
    """Return which echoes (n,) lie where something of their kind is known to be."""
    if not tracks:
        return np.zeros(len(echoes.x), np.bool_)
    x, y = np.array([track.state[:2] for track in tracks]).T
    is_kart = np.array([track.kind == codes.KART_HIT for track in tracks])
    is_like = (echoes.kinds == codes.KART_HIT)[:, None] == is_kart
    near = np.hypot(echoes.x[:, None] - x, echoes.y[:, None] - y) < GATE
    return np.asarray((is_like & near).any(axis=1))


def _appears(echoes: Echoes, times: NDArray[np.int64], past: Past) -> NDArray[np.bool_]:
    """Return which echoes (n,) appear where nothing was. times: (n,) scans in which it was."""
    appears = times <= 1
    if appears.any():
        appears[appears] = _seen_through(echoes.kept(appears), past) >= CLEAR
    return appears


def _seen_through(echoes: Echoes, past: Past) -> NDArray[np.int64]:
    """Return in how many earlier scans the radar saw something behind the places of echoes (n,).

    No person appears where it just saw the ground behind; a mirrored or a stray echo does. Each
    scan saw from where the radar was then: what is near lies elsewhere in the view by now.
    """
    x, y = past.echoes.x - past.x, past.echoes.y - past.y
    here_x, here_y = echoes.x[:, None] - past.x, echoes.y[:, None] - past.y
    theirs, far = np.hypot(x, y), np.hypot(here_x, here_y)
    aside, ahead = here_x * y - here_y * x, here_x * x + here_y * y
    is_same = np.abs(aside) < math.tan(SAME) * ahead
    through = is_same & (theirs > far + BEHIND)
    return np.stack([through[:, past.ago == ago].any(axis=1) for ago in range(1, 1 + SCANS)]).sum(
        axis=0
    )


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


def _continues_border(echoes: Echoes, asked: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which of those asked for (n,) lie on the line of the last echoes of a border before.

    So a border goes on beyond the last echo that was taken for it.
    """
    found = np.zeros(len(echoes.x), np.bool_)
    border = np.flatnonzero(echoes.kinds == codes.BORDER)
    ways, far = np.arctan2(echoes.y, echoes.x), np.hypot(echoes.x, echoes.y)
    for number in np.flatnonzero(asked).tolist():
        before = (np.abs(ways[border] - ways[number]) < NEIGHBOURS) & (far[border] < far[number])
        beside = border[before]
        if len(beside) < 2:
            continue
        x, y = echoes.x[beside] - echoes.x[number], echoes.y[beside] - echoes.y[number]
        near = np.argsort(np.hypot(x, y))[:2]
        (x0, x1), (y0, y1) = x[near].tolist(), y[near].tolist()
        off, length = abs(x0 * y1 - y0 * x1), math.hypot(x1 - x0, y1 - y0)
        is_near = math.hypot(x1, y1) < GOES_ON or math.hypot(x0, y0) < AS_FAR * length
        found[number] = off < BESIDE_LINE * length and is_near
    return found


def _outvoted(
    echoes: Echoes, here: NDArray[np.float32], before: NDArray[np.float32]
) -> NDArray[np.uint8]:
    """Return kinds (n,): a kart among people, or a person among karts, is one of the others.

    What was taken for a person before, too, is one: a child who comes from behind a kart. But of
    that number of a kart's echoes a few are mistaken again and again.

    here, before: (n, 4) echoes near each in this scan, and in earlier ones.
    """
    people = before[:, PEOPLE]
    karts, others = here[:, KART] + before[:, KART], here[:, PEOPLE] + people
    # Without any other of its kind one among karts is enough: a stray echo is confirmed by those.
    few = karts > np.where(others == 0.0, 0.0, others + 1.0)
    few = few & (people == 0.0) | (karts >= CONFUSED * (others + 1.0))
    is_alone = echoes.may_be_people & few
    kinds = np.where(is_alone, codes.KART_HIT, echoes.kinds)
    is_kart = echoes.kinds == codes.KART_HIT
    return np.where(is_kart & (others > karts + 1.0), codes.OBSTACLE, kinds).astype(np.uint8)


def are_near(one: Echoes, other: Echoes) -> NDArray[np.bool_]:
    """Return which pairs may be of one thing, shape (n, m)."""
    dx, dy = one.x[:, None] - other.x, one.y[:, None] - other.y
    alike = np.abs(one.closing[:, None] - other.closing) < ALIKE
    return np.asarray((dx * dx + dy * dy < NEAR * NEAR) & alike)
