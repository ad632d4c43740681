"""Encode and decode what a real kart tells the others: where it is, how it moves, how it brakes."""

import math
import struct
from dataclasses import dataclass

import flatbuffers

from race_server.core.peer import Peer
from race_server.errors import Reason, WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.drive import Peer as PeerStruct
from race_server.net.wire.generated.drive import PeerMessage
from race_server.net.wire.pose import MOST_METRES, MOST_RATE, MOST_SPEED
from race_server.net.wire.strict import root_of

PEER = struct.Struct("<QQI11fH6x")
# Beyond any brake [m/s²], and any vehicle that races [m].
MOST_BRAKING, MOST_SIZE = 100.0, 50.0
MOST_STAMP_US = 1 << 62  # beyond any clock
_HIGHEST = (
    *(MOST_METRES, MOST_METRES, 2.0 * math.pi, MOST_SPEED, MOST_SPEED, MOST_RATE),
    *(MOST_BRAKING, MOST_METRES, 2.0 * math.pi, MOST_SIZE, MOST_SIZE),
)
# Numbers from this one on are never negative: braking, deviations, sizes.
_POSITIVE = 6


@dataclass(frozen=True, slots=True)
class PeerFrame:
    """What a kart tells, with its epoch, and an answer to the clock of one other kart."""

    epoch: int
    peer: Peer
    answered: int = 0  # seat whose clock `echo_us` is of
    echo_us: int = 0  # 0 for none


def encode_peer(frame: PeerFrame) -> bytes:
    """Return it as a message."""
    peer, builder = frame.peer, flatbuffers.Builder(128)
    PeerMessage.Start(builder)
    place = PeerStruct.CreatePeer(
        *(builder, peer.stamp_us, frame.echo_us, frame.epoch, peer.x, peer.y, peer.heading),
        *(peer.speed, peer.lateral_speed, peer.yaw_rate, peer.braking, peer.deviation),
        *(peer.heading_deviation, peer.length, peer.width, frame.answered),
    )
    PeerMessage.AddPeer(builder, place)
    builder.Finish(PeerMessage.End(builder), topics.PEER.identifier)
    return bytes(builder.Output())


def decode_peer(data: bytes) -> PeerFrame:
    """Return what a message tells.

    Raises:
        WireError: damaged, oversized, foreign, not finite or out of range; nothing else.
    """
    table = root_of(data, topics.PEER.identifier, topics.PEER.most_bytes)
    stamp_us, echo_us, epoch, *values, answered = table.packed(0, PEER, "peer")
    # Comparisons with NaN are false, so NaN is refused here too.
    within = all(-most <= value <= most for value, most in zip(values, _HIGHEST, strict=True))
    if not within or min(values[_POSITIVE:]) < 0.0 or max(stamp_us, echo_us) > MOST_STAMP_US:
        raise WireError(f"peer out of range: {stamp_us} µs, {values}", Reason.OUT_OF_RANGE)
    return PeerFrame(epoch, Peer(stamp_us, *values), answered, echo_us)
