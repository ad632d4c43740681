"""The other real karts of a race, as one kart tells them of itself and hears of them.

They are peers on one network, with a server or without. Each clock is set against this kart's by
what it answers, so the age of each message is known.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Protocol

from race_agents.unit.peers import EARLIEST_S, OLDEST_S
from race_agents.unit.records import MOST_TOLD, Report
from race_server.core.clock import MICROSECONDS
from race_server.core.link_clock import LinkClock
from race_server.core.messages import Pose
from race_server.core.peer import Peer
from race_server.core.vehicles import Vehicle
from race_server.errors import WireError
from race_server.net.wire.peer import PeerFrame, decode_peer, encode_peer

# After this long a silence [s] a kart may have been started again, with another clock.
GONE_S = 2.0


class Radio(Protocol):
    """What carries messages to the other karts."""

    def tell(self, data: bytes) -> None:
        """Tell all of them."""

    def close(self) -> None:
        """Tell and hear no more."""


@dataclass
class _Heard:
    """What was heard of one kart."""

    clock: LinkClock = field(default_factory=LinkClock)
    stamp_us: int = -1  # the newest, by its own clock
    arrived_s: float = -math.inf
    peer: Peer | None = None  # its stamp by our clock

    def is_fresh(self, now_s: float) -> bool:
        """Return whether it was where it told a short while ago, and not in the future."""
        if self.peer is None:
            return False
        return -EARLIEST_S <= now_s - self.peer.stamp_us / MICROSECONDS <= OLDEST_S


class Peers:
    """Keeps the newest that each of the other karts told, and tells them."""

    def __init__(self, seat: int) -> None:
        """Begin without any. seat: of this kart."""
        self.seat = seat
        self.radio: Radio | None = None  # None: out of reach
        self.ignored = 0  # messages that were damaged, repeated, old, or of another race
        self._arrived: dict[int, tuple[bytes, float]] = {}  # the newest message of each seat
        self._heard: dict[int, _Heard] = {}
        self._turns = 0

    def store(self, seat: int, data: bytes, now_s: float) -> None:
        """Take a message as it arrives; called by the transport's thread."""
        self._arrived[seat] = data, now_s

    def hear(self, epoch: int, own: Pose | None, now_s: float) -> tuple[Peer, ...]:
        """Return what is known of the others, the nearest first; their stamps are of our clock.

        epoch: of the race; a kart in another race may be on another course.
        """
        while self._arrived:
            seat, (data, arrived_s) = self._arrived.popitem()
            if seat == self.seat or not self._take(seat, data, arrived_s, epoch):
                self.ignored += 1
        fresh = [heard.peer for heard in self._heard.values() if heard.is_fresh(now_s)]
        peers = [peer for peer in fresh if peer is not None]
        if own is not None:
            peers.sort(key=lambda peer: math.hypot(peer.x - own.x, peer.y - own.y))
        return tuple(peers[:MOST_TOLD])

    def _take(self, seat: int, data: bytes, arrived_s: float, epoch: int) -> bool:
        """Take a message; return whether it says something new."""
        try:
            frame = decode_peer(data)
        except WireError:
            return False
        if frame.epoch != epoch:
            return False
        heard, peer = self._heard.setdefault(seat, _Heard()), frame.peer
        if arrived_s - heard.arrived_s > GONE_S:
            heard = self._heard[seat] = _Heard()
        if peer.stamp_us <= heard.stamp_us:
            return False
        echo_us = frame.echo_us if frame.answered == self.seat else 0
        heard.clock.record(peer.stamp_us, round(arrived_s * MICROSECONDS), echo_us)
        heard.stamp_us, heard.arrived_s = peer.stamp_us, arrived_s
        heard.peer = replace(peer, stamp_us=round(peer.stamp_us + heard.clock.offset_us))
        return heard.is_fresh(arrived_s)

    def tell(self, report: Report, vehicle: Vehicle, epoch: int, now_s: float) -> None:
        """Tell where this kart is, and answer the clock of one of the others in turn."""
        if self.radio is None or report.pose is None:
            return
        self._turns += 1
        answered, echo_us = self._answer(now_s)
        told = PeerFrame(epoch, peer_of(report, report.pose, vehicle), answered, echo_us)
        self.radio.tell(encode_peer(told))

    def _answer(self, now_s: float) -> tuple[int, int]:
        """Return a seat, and its newest stamp plus the time since."""
        if not self._heard:
            return 0, 0
        seats = sorted(self._heard)
        seat = seats[self._turns % len(seats)]
        heard = self._heard[seat]
        if heard.stamp_us < 0 or now_s - heard.arrived_s > GONE_S:
            return 0, 0
        return seat, heard.stamp_us + round((now_s - heard.arrived_s) * MICROSECONDS)

    def close(self) -> None:
        """Tell and hear no more."""
        if self.radio is not None:
            self.radio.close()


def peer_of(report: Report, pose: Pose, vehicle: Vehicle) -> Peer:
    """Return what a kart tells the others: of the middle of its body."""
    ahead = vehicle.box_offset
    return Peer(
        stamp_us=pose.stamp_us,
        x=pose.x + ahead * math.cos(pose.heading),
        y=pose.y + ahead * math.sin(pose.heading),
        heading=math.remainder(pose.heading, 2.0 * math.pi),
        speed=pose.speed,
        lateral_speed=pose.lateral_speed + ahead * pose.yaw_rate,
        yaw_rate=pose.yaw_rate,
        braking=report.braking,
        deviation=pose.deviation,
        heading_deviation=report.health.heading_deviation,
        length=vehicle.length,
        width=vehicle.width,
    )
