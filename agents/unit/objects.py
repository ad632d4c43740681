"""Objects around a kart, made of echoes: where they are, how they move, what they are.

Confirmed echoes of one thing make a track: its place by a Kalman filter, its speed along the ray by
Doppler shift. A person who steps out is one after two scans. Places are in a frame that is carried
along by the kart's own speed and turning, which never jumps as a fix does.
"""

import math
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from race_agents.unit.confirmation import ALIKE, Past, are_near, are_tracked, confirmed
from race_agents.unit.ego import Ego
from race_agents.unit.safety import Echoes
from race_agents.unit.track import (
    BORN,
    DOPPLER,
    FIRST_SPEED,
    GATE,
    Track,
    carry,
    correct,
    distance_to,
    spread_of,
)
from race_server.core import codes

Floats = NDArray[np.float64]

SPREAD = 1.2  # [m] within which echoes of one thing lie of one another
GONE = 5  # scans without an echo after which a track is gone
MOST_TRACKS = 64  # more than a radar has beams; of more the nearest are kept
# What is faster than this [m/s] is no person, but a kart; among echoes of a kart that move alike,
# what is faster than that.
RUNS, RUNS_BESIDE = 5.0, 3.0


@dataclass
class Objects:
    """What was seen, and what is there."""

    radar: float = 0.0  # [m] that the radar is ahead of the rear axle
    tracks: list[Track] = field(default_factory=list)
    seen: Echoes = field(default_factory=Echoes.nothing)  # the confirmed echoes of the last scan
    loose: Echoes = field(default_factory=Echoes.nothing)  # those that are of no known kart
    _past: Past = field(default_factory=Past.nothing)
    _born: int = 0

    def look(self, echoes: Echoes, ego: Ego, dt: float) -> None:
        """Take a scan, `dt` seconds after the one before."""
        echoes = taken_for_karts(echoes, ego, self.radar)
        self._past = self._past.carried(ego, dt, self.radar)
        for track in self.tracks:
            carry(track, ego, dt)
        self.seen = confirmed(echoes, self._past, self.tracks, self.radar)
        self._past = self._past.with_scan(echoes, self.radar)
        things = self.seen.without_borders()
        for group in groups_of(things, self.radar):
            self._take(things.kept(group), ego, dt)
        self.tracks = [track for track in self.tracks if track.missed <= GONE]
        if len(self.tracks) > MOST_TRACKS:
            self.tracks = sorted(self.tracks, key=lambda track: distance_to(track, 0.0, 0.0))
            del self.tracks[MOST_TRACKS:]
        karts = [track for track in self.tracks if track.kind == codes.KART_HIT]
        ways_known = [track for track in karts if track.scans >= BORN]
        self.loose = self.seen.kept(~are_tracked(self.seen, ways_known))

    def _take(self, echoes: Echoes, ego: Ego, dt: float) -> None:
        """Let the nearest track of this kind take echoes of one thing, or begin one."""
        x, y = float(echoes.x.mean()), float(echoes.y.mean())
        kind = int(np.bincount(echoes.kinds).argmax())
        far = max(math.hypot(x - self.radar, y), 1e-6)
        ray = np.array([x - self.radar, y]) / far
        across = np.abs(echoes.y * ray[0] - echoes.x * ray[1] - (y * ray[0] - x * ray[1]))
        half = float(across.max()) + 0.15
        # Over ground, along the ray: what the kart itself adds to the closing speed is taken off.
        own = ego.speed * ray[0] + ego.aside * ray[1]
        doppler = own - float(echoes.closing.mean())
        free = [track for track in self.tracks if track.missed > 0 and _may_be(track, kind)]
        best = min(free, key=lambda track: distance_to(track, x, y), default=None)
        if best is not None and distance_to(best, x, y) < GATE:
            before = float(best.state[2:] @ ray)
            is_hit = correct(best, np.array([x, y]), ray, doppler)
            best.scans, best.missed = best.scans + 1, 0
            best.half_width += 0.3 * (half - best.half_width)
            best.kind = kind if best.scans < BORN or kind == best.kind else best.kind
            if not is_hit:  # a blow is no braking, and does not go on
                best.slow_down(ray, (before - float(best.state[2:] @ ray)) / max(dt, 1e-3))
            return
        self._born += 1
        state = np.array([x, y, *(doppler * ray)])
        spread = np.diag([0.0, 0.0, FIRST_SPEED**2, FIRST_SPEED**2])
        spread[:2, :2] = spread_of(ray, far, kind)
        # Along the ray the speed is known at once.
        spread[2:, 2:] -= (FIRST_SPEED**2 - DOPPLER**2) * np.outer(ray, ray)
        began, eye = math.hypot(x, y), (self.radar, 0.0)
        self.tracks.append(
            Track(state, spread, kind, half, number=self._born, began=began, eye=eye)
        )


def _may_be(track: Track, kind: int) -> bool:
    """Return whether a track may be of what echoes of a kind are of.

    Once it is known what it is, a child that comes from behind a kart is not the kart.
    """
    return track.scans < BORN or (track.kind == codes.KART_HIT) == (kind == codes.KART_HIT)


def taken_for_karts(echoes: Echoes, ego: Ego, radar: float) -> Echoes:
    """Return echoes of which those that are too fast to be of people are of karts.

    radar: [m] that the radar is ahead of the rear axle.
    """
    ahead = echoes.x - radar
    far = np.maximum(np.hypot(ahead, echoes.y), 1e-6)
    pace = np.abs((ego.speed * ahead + ego.aside * echoes.y) / far - echoes.closing)
    runs = echoes.may_be_people & (pace > RUNS_BESIDE)
    if not runs.any():
        return echoes
    karts = echoes.kept(echoes.kinds == codes.KART_HIT)
    runs &= (pace > RUNS) | are_near(echoes, karts).any(axis=1)
    return replace(echoes, kinds=np.where(runs, codes.KART_HIT, echoes.kinds).astype(np.uint8))


def groups_of(echoes: Echoes, radar: float = 0.0) -> list[NDArray[np.bool_]]:
    """Return masks of echoes that are of one thing each: chains in the order of their bearing.

    What closes at another speed is another thing: karts that touch each other are two. radar: [m]
    that the radar is ahead of the rear axle.
    """
    groups: list[NDArray[np.bool_]] = []
    last = -1
    for number in np.argsort(np.arctan2(echoes.y, echoes.x - radar)).tolist():
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
