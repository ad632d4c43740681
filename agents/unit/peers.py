"""Other real karts as they tell of themselves: objects beside those that the radar sees.

A peer may err, or lie. Its tracks stand beside the radar's and change none of them, so it can only
add danger. What is no number, old, of the future, far outside of the course, or less sure of its
place than half a kart is ignored, and of many peers the nearest count.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields
from operator import attrgetter

import numpy as np

from race_agents.unit.danger import NO_DANGER, worst_ahead
from race_agents.unit.drift import Arcs
from race_agents.unit.fence import Fence
from race_agents.unit.limits import Limits
from race_agents.unit.readings import MICROSECONDS
from race_agents.unit.safety import Echoes
from race_agents.unit.track import BORN, Track
from race_server.core import codes
from race_server.core.alert import Danger
from race_server.core.peer import Peer

# What a kart told longer ago than this [s] is ignored, and what it tells from as far in the future.
OLDEST_S, EARLIEST_S = 0.5, 0.05
# … and what it tells from farther outside the kerb than this [m]: there it is in no kart's way.
OUTSIDE = 5.0
# At most this many peers count: each costs as much as three tracks.
MOST_PEERS = 8
# How much a kart may change its way untold [m/s²], and the deviation of a told speed [m/s].
CHANGES, SPEED = 6.0, 0.3
# In this many turns with other work what they told before holds.
MOST_TURNS = 2
# A point this far [m] behind the axle, and as far again as beside it, is behind on each way that a
# kart may drive: the direction in which it slides is turned by less than 45°.
BEHIND = 3.0
_numbers_of = attrgetter(*(each.name for each in fields(Peer)))


@dataclass(frozen=True)
class Whereabouts:
    """Where a kart is itself: the middle of its rear axle."""

    x: float
    y: float
    heading: float
    deviation: float  # [m]
    heading_deviation: float  # [rad]
    time_s: float


@dataclass
class PeerWatch:
    """The danger that others are by what they tell: it stands beside what the radar sees.

    Nothing here is asked by, or changes, what the kart does for what it sees itself.
    """

    peers: tuple[Peer, ...] = ()  # what other real karts told last
    danger: Danger = NO_DANGER
    _may_wait: int = 0  # turns in which what was found last may hold

    def look(
        self, own: Whereabouts, fence: Fence, limits: Limits, arcs: Arcs, *, is_busy: bool
    ) -> Danger:
        """Return the worst of what others tell now.

        is_busy: this turn has much work already; then what was found last holds once more, but not
        for longer than `MOST_TURNS`: less than the way of a message takes.
        """
        if not self.peers:
            self.danger, self._may_wait = NO_DANGER, 0
        elif is_busy and self._may_wait:
            self._may_wait -= 1
        else:
            tracks = tracks_of(self.peers, own, fence, limits.half_width)
            self.danger = worst_ahead(tracks, Echoes.nothing(), arcs, limits)
            self._may_wait = MOST_TURNS
        return self.danger


def tracks_of(
    peers: Iterable[Peer], own: Whereabouts, fence: Fence, most_unsure: float
) -> list[Track]:
    """Return peers as tracks in the kart's frame of now: front, middle and rear of each.

    most_unsure: deviation of a place [m] above which it tells nothing.
    """
    found = [
        (math.hypot(peer.x - own.x, peer.y - own.y), peer)
        for peer in peers
        if _is_heard(peer, own.time_s, fence)
    ]
    near = sorted(found, key=lambda pair: pair[0])[:MOST_PEERS]
    return [track for far, peer in near for track in _ends_of(peer, far, own, most_unsure)]


def _is_heard(peer: Peer, now_s: float, fence: Fence) -> bool:
    if not all(map(math.isfinite, _numbers_of(peer))):
        return False
    age_s = now_s - peer.stamp_us / MICROSECONDS
    return -EARLIEST_S <= age_s <= OLDEST_S and fence.beyond(peer.x, peer.y) <= OUTSIDE


def _ends_of(peer: Peer, far: float, own: Whereabouts, most_unsure: float) -> Sequence[Track]:
    """Return the tracks of one peer, moved on to now.

    They are nearer by the deviation of its place, and by half its width as far as it comes across.
    """
    age_s = max(own.time_s - peer.stamp_us / MICROSECONDS, 0.0)
    unsure = math.hypot(
        *(own.deviation, peer.deviation, own.heading_deviation * far),
        0.5 * CHANGES * age_s**2,
    )
    if unsure > most_unsure:
        return ()
    midway = peer.heading + 0.5 * peer.yaw_rate * age_s - own.heading
    x, y = _turned(peer.x - own.x, peer.y - own.y, -own.heading)
    ahead, left = _turned(peer.speed * age_s, peer.lateral_speed * age_s, midway)
    x, y, heading = x + ahead, y + left, midway + 0.5 * peer.yaw_rate * age_s
    turned = math.hypot(own.heading_deviation, peer.heading_deviation)
    place, pace = unsure**2, SPEED**2 + (turned * peer.speed) ** 2
    by = unsure + 0.5 * peer.width * abs(math.sin(heading))
    spread = np.diag([place, place, pace, pace])
    tracks = []
    for along in (-0.5 * peer.length, 0.0, 0.5 * peer.length):
        dx, dy = _turned(along, 0.0, heading)
        vx, vy = _turned(peer.speed, peer.lateral_speed + peer.yaw_rate * along, heading)
        if x + dx < -BEHIND - 1.1 * abs(y + dy):
            continue  # brakes do not help
        distance = math.hypot(x + dx, y + dy)
        nearer = max(distance - by, 0.0) / max(distance, 1e-6)
        state = np.array([nearer * (x + dx), nearer * (y + dy), vx, vy])
        tracks.append(
            Track(
                *(state, spread, codes.KART_HIT, 0.5 * peer.width),
                scans=BORN,
                slowing=peer.braking,
                braking=peer.braking,
                began=distance,
            )
        )
    return tracks


def _turned(x: float, y: float, angle: float) -> tuple[float, float]:
    cos, sin = math.cos(angle), math.sin(angle)
    return cos * x - sin * y, sin * x + cos * y
