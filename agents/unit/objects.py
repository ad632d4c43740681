"""Objects around a kart, made of echoes: where they are, how they move, what they are.

An echo counts once another one confirms it: of an earlier scan, from where it must have come by
its closing speed, or of the same thing beside it. So stray echoes are no objects, and a person who
steps out is one after two scans. Confirmed echoes of one thing make a track: its place by a
constant-velocity Kalman filter, its speed along the ray by Doppler shift. Places are in a frame
that is carried along by the kart's own speed and turning, which never jumps as a fix does.
"""

import math
from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.ego import Ego
from race_agents.unit.safety import Echoes
from race_server.core import codes

Floats = NDArray[np.float64]

# An echo and what confirms it lie within this [m] of each other, with closing speeds [m/s] within
# that; the scans before that are looked at.
NEAR, ALIKE, SCANS = 0.7, 2.0, 3
# Echoes beside it, of the same scan, that confirm one as well.
BESIDE = 2
# A place is seen through where an echo came from this much [m] behind it, at a bearing [rad] this
# near. Where it was in this number of scans nothing stands yet: two scans have to say that it does.
BEHIND, SAME, CLEAR = 1.0, 0.025, 2
# Echoes of one thing lie within this of one another [m]; a track takes what lies this near.
SPREAD, GATE = 1.2, 1.5
# A track moves after this many scans, and is gone after that many without an echo.
BORN, GONE = 3, 5
# Deviations: of a thing's middle [m], of Doppler speeds [m/s], of a bearing [rad].
PLACE, DOPPLER, BEARING = 0.15, 0.2, 0.012
OUTLINE = 0.5  # [m] by which the middle of the echoes of a kart moves about
# How much a person and a kart change their speed [m/s in √s].
RESTLESS, DRIVEN = 0.7, 2.0
FIRST_SPEED = 3.0  # [m/s] deviation of what a thing may do when it is first seen
MOST_TRACKS = 24
# What is faster than this [m/s] is no person, but a kart.
RUNS = 5.0
# What moves away more slowly than this [m/s] stands.
STANDS = 1.0
# A speed across the ray below this many deviations is none; of karts, whose outline comes into view
# side by side, below the second.
NOISE, PLAIN = 1.2, 3.0


@dataclass
class Track:
    """One thing, in the kart's frame: its nearest point's place [m] and velocity over ground."""

    state: Floats  # (4,) x, y [m], vx, vy [m/s]
    covariance: Floats  # (4, 4)
    kind: int  # RayHit
    half_width: float  # [m] across the ray
    scans: int = 1
    missed: int = 0
    slowing: float = 0.0  # [m/s²] by which its speed shrinks, smoothed
    braking: float = 0.0  # [m/s²] that it told to ask of its brakes
    number: int = 0
    began: float = 0.0  # [m] away when it was first seen

    @property
    def velocity(self) -> tuple[float, float]:
        """Velocity over ground [m/s]: across the ray none that could as well be noise."""
        x, y, vx, vy = (float(value) for value in self.state)
        far = max(math.hypot(x, y), 1e-6)
        ray = np.array([x, y]) / far
        side = np.array([-ray[1], ray[0]])
        along, across = float(ray @ (vx, vy)), float(side @ (vx, vy))
        clear = PLAIN if self.kind == codes.KART_HIT else NOISE
        if across * across < clear**2 * float(side @ self.covariance[2:, 2:] @ side):
            across = 0.0
        east, north = along * ray + across * side
        return float(east), float(north)

    @property
    def leaves(self) -> float:
        """Speed over ground along the ray [m/s], negative where it comes."""
        x, y, vx, vy = (float(value) for value in self.state)
        return (x * vx + y * vy) / max(math.hypot(x, y), 1e-6)

    @property
    def stands(self) -> bool:
        """Whether it does not move away."""
        return self.leaves < STANDS

    @property
    def unsure(self) -> float:
        """Deviation of the velocity [m/s], in its worse direction at most."""
        return math.sqrt(max(float(self.covariance[2, 2] + self.covariance[3, 3]), 0.0))


@dataclass
class Objects:
    """What was seen, and what is there."""

    tracks: list[Track] = field(default_factory=list)
    seen: Echoes = field(default_factory=Echoes.nothing)  # the confirmed echoes of the last scan
    loose: Echoes = field(default_factory=Echoes.nothing)  # those that are of no known kart
    _earlier: deque[Echoes] = field(default_factory=lambda: deque(maxlen=SCANS))
    _born: int = 0

    def look(self, echoes: Echoes, ego: Ego, dt: float) -> None:
        """Take a scan, `dt` seconds after the one before."""
        echoes = taken_for_karts(echoes, ego)
        self._earlier = deque((moved(each, ego, dt) for each in self._earlier), maxlen=SCANS)
        for track in self.tracks:
            carry(track, ego, dt)
        self.seen = confirmed(echoes, self._earlier, self.tracks)
        self._earlier.append(echoes)
        things = self.seen.without_borders()
        for group in groups_of(things):
            self._take(things.kept(group), ego, dt)
        self.tracks = [track for track in self.tracks if track.missed <= GONE][-MOST_TRACKS:]
        self.loose = self.seen.kept(~self._is_known())

    def _is_known(self) -> NDArray[np.bool_]:
        """Return which confirmed echoes are of a kart whose way is known, shape (n,)."""
        known = np.zeros(len(self.seen.x), np.bool_)
        for track in self.tracks:
            if track.kind == codes.KART_HIT and track.scans >= BORN:
                near = np.hypot(self.seen.x - track.state[0], self.seen.y - track.state[1]) < GATE
                known |= near & (self.seen.kinds == codes.KART_HIT)
        return known

    def _take(self, echoes: Echoes, ego: Ego, dt: float) -> None:
        """Let the nearest track of this kind take echoes of one thing, or begin one."""
        x, y = float(echoes.x.mean()), float(echoes.y.mean())
        kind = int(np.bincount(echoes.kinds).argmax())
        far = max(math.hypot(x, y), 1e-6)
        ray = np.array([x, y]) / far
        across = np.abs(echoes.y * ray[0] - echoes.x * ray[1] - (y * ray[0] - x * ray[1]))
        half = float(across.max()) + 0.15
        # Over ground, along the ray: what the kart itself adds to the closing speed is taken off.
        own = ego.speed * ray[0] + ego.aside * ray[1]
        doppler = own - float(echoes.closing.mean())
        free = [track for track in self.tracks if track.missed > 0]
        best = min(free, key=lambda track: _off(track, x, y), default=None)
        if best is not None and _off(best, x, y) < GATE:
            before = float(best.state[2:] @ ray)
            correct(best, np.array([x, y]), ray, doppler)
            best.scans, best.missed = best.scans + 1, 0
            best.half_width += 0.3 * (half - best.half_width)
            best.kind = kind if best.scans < BORN or kind == best.kind else best.kind
            slows = (before - float(best.state[2:] @ ray)) / max(dt, 1e-3)
            best.slowing += 0.2 * (slows - best.slowing)
            return
        self._born += 1
        state = np.array([x, y, *(doppler * ray)])
        spread = np.diag([0.0, 0.0, FIRST_SPEED**2, FIRST_SPEED**2])
        spread[:2, :2] = _spread(ray, far, kind)
        # Along the ray the speed is known at once.
        spread[2:, 2:] -= (FIRST_SPEED**2 - DOPPLER**2) * np.outer(ray, ray)
        self.tracks.append(Track(state, spread, kind, half, number=self._born, began=far))


def taken_for_karts(echoes: Echoes, ego: Ego) -> Echoes:
    """Return echoes of which those that are too fast to be of people are of karts."""
    far = np.maximum(np.hypot(echoes.x, echoes.y), 1e-6)
    own = (ego.speed * echoes.x + ego.aside * echoes.y) / far
    runs = echoes.may_be_people & (np.abs(own - echoes.closing) > RUNS)
    return replace(echoes, kinds=np.where(runs, codes.KART_HIT, echoes.kinds).astype(np.uint8))


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


def confirmed(echoes: Echoes, earlier: deque[Echoes], tracks: Sequence[Track] = ()) -> Echoes:
    """Return those echoes that others confirm. tracks: where something is known to be.

    One whose kind few others confirm is of the kind of those that lie around it.
    """
    if len(echoes.x) == 0:
        return echoes
    beside = _is_near(echoes, echoes)
    np.fill_diagonal(beside, val=False)
    is_thing = echoes.kinds != codes.BORDER
    votes = np.zeros((2, len(echoes.x)), np.int64)  # for a border, for a thing
    times = np.zeros(len(echoes.x), np.int64)
    nears = [_is_near(echoes, scan) for scan in earlier]
    for near, scan in zip(nears, earlier, strict=True):
        thing = scan.kinds != codes.BORDER
        times += near.any(axis=1)
        votes[1] += (near & thing).any(axis=1)
        votes[0] += (near & ~thing).any(axis=1) & ~(near & thing).any(axis=1)
    around = np.stack([(beside & ~is_thing).sum(axis=1), (beside & is_thing).sum(axis=1)])
    kept = (times >= 1) | (around.sum(axis=0) >= BESIDE)
    appears = (times <= 1) & (_seen_through(echoes, earlier) >= CLEAR)
    for track in tracks:
        is_like = (echoes.kinds == codes.KART_HIT) == (track.kind == codes.KART_HIT)
        near = np.hypot(echoes.x - track.state[0], echoes.y - track.state[1]) < GATE
        appears &= ~(is_like & near)
    kept &= ~appears
    for_border, for_thing = votes + around
    # What nothing else takes for a thing lies on a border, or is a stray; where anything takes it
    # for a border, two others have to.
    least = np.where(for_border > 0, np.maximum(for_border, 2), 1)
    doubtful = is_thing & (for_thing < least)
    kinds = np.where(doubtful, codes.BORDER, _outvoted(echoes, earlier, nears, beside)).astype(
        np.uint8
    )
    return Echoes(echoes.x, echoes.y, echoes.closing, kinds).kept(kept)


def _seen_through(echoes: Echoes, earlier: deque[Echoes]) -> NDArray[np.int64]:
    """Return in how many earlier scans the radar saw something behind the places of echoes (n,).

    No person appears where it just saw the ground behind; a mirrored or a stray echo does.
    """
    far, ways = np.hypot(echoes.x, echoes.y), np.arctan2(echoes.y, echoes.x)
    through = np.zeros(len(far), np.int64)
    for scan in earlier:
        off = np.abs(np.arctan2(scan.y, scan.x) - ways[:, None])
        behind = np.hypot(scan.x, scan.y) > far[:, None] + BEHIND
        through += ((off < SAME) & behind).any(axis=1)
    return through


def _outvoted(
    echoes: Echoes,
    earlier: deque[Echoes],
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


def _is_near(one: Echoes, other: Echoes) -> NDArray[np.bool_]:
    """Return which pairs may be of one thing, shape (n, m)."""
    dx, dy = one.x[:, None] - other.x, one.y[:, None] - other.y
    alike = np.abs(one.closing[:, None] - other.closing) < ALIKE
    return np.asarray((dx * dx + dy * dy < NEAR * NEAR) & alike)


def groups_of(echoes: Echoes) -> list[NDArray[np.bool_]]:
    """Return masks of echoes that are of one thing each: chains in the order of their bearing.

    What closes at another speed is another thing: karts that touch each other are two.
    """
    groups: list[NDArray[np.bool_]] = []
    last = -1
    for number in np.argsort(np.arctan2(echoes.y, echoes.x)).tolist():
        joined = last >= 0 and echoes.kinds[number] == echoes.kinds[last]
        if joined:
            dx, dy = echoes.x[number] - echoes.x[last], echoes.y[number] - echoes.y[last]
            alike = abs(float(echoes.closing[number] - echoes.closing[last])) < ALIKE
            joined = alike and math.hypot(dx, dy) < SPREAD
        if not joined:
            groups.append(np.zeros(len(echoes.x), np.bool_))
        groups[-1][number] = True
        last = number
    return groups


def carry(track: Track, ego: Ego, dt: float) -> None:
    """Move a track on, and into the kart's frame of now."""
    cos, sin = math.cos(ego.turned), math.sin(ego.turned)
    turn = np.array([[cos, sin], [-sin, cos]])
    state = track.state.copy()
    state[:2] += state[2:] * dt - (ego.ahead, ego.left)
    both = np.zeros((4, 4))
    both[:2, :2] = both[2:, 2:] = turn
    slope = np.eye(4)
    slope[0, 2] = slope[1, 3] = dt
    slope = both @ slope
    track.state = both @ state
    pace = DRIVEN if track.kind == codes.KART_HIT else RESTLESS
    noise = pace**2 * np.diag([dt**3 / 3.0, dt**3 / 3.0, dt, dt])
    track.covariance = slope @ track.covariance @ slope.T + noise
    track.missed += 1


def correct(track: Track, place: Floats, ray: Floats, doppler: float) -> None:
    """Correct a track by a place (2,) [m] and a speed over ground along a ray [m/s]."""
    rows = np.zeros((3, 4))
    rows[0, 0] = rows[1, 1] = 1.0
    rows[2, 2:] = ray
    residual = np.array([*place, doppler]) - rows @ track.state
    noise = np.zeros((3, 3))
    noise[:2, :2] = _spread(ray, math.hypot(*place), track.kind)
    noise[2, 2] = DOPPLER**2
    gain = track.covariance @ rows.T @ np.linalg.inv(rows @ track.covariance @ rows.T + noise)
    track.state = track.state + gain @ residual
    keep = np.eye(4) - gain @ rows
    track.covariance = keep @ track.covariance @ keep.T + gain @ noise @ gain.T


def _spread(ray: Floats, far: float, kind: int) -> Floats:
    """Return the covariance of a place (2, 2) [m²]: wider across the ray the farther it is."""
    along, across = np.outer(ray, ray), np.outer((-ray[1], ray[0]), (-ray[1], ray[0]))
    size = OUTLINE if kind == codes.KART_HIT else PLACE
    return np.asarray(PLACE**2 * along + (size**2 + (BEARING * far) ** 2) * across)


def _off(track: Track, x: float, y: float) -> float:
    return math.hypot(track.state[0] - x, track.state[1] - y)
