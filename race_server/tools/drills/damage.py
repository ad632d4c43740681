"""Damaged and crafted messages, and how the decoders of the server take them."""

import gc
import random
import struct
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from race_server.core.messages import Button, Control, Pose
from race_server.errors import WireError
from race_server.net.wire import topics
from race_server.net.wire.admin import Decision, decode_decision, encode_decision
from race_server.net.wire.drive import ControlFrame, decode_control, encode_control
from race_server.net.wire.lobby import Join, SeatAct, decode_join, decode_seat_act, encode_join
from race_server.net.wire.lobby import encode_seat_act as encode_act
from race_server.net.wire.pose import PoseFrame, decode_pose, encode_pose
from race_server.net.wire.topics import Topic

# Values at which readers of offsets and counts fail.
HOSTILE_WORDS = (0, 1, 4, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFF0, 0xFFFFFFFF)
U32 = struct.Struct("<I")


@dataclass(frozen=True)
class Inbound:
    """A topic on which clients send to the server."""

    topic: Topic
    sample: bytes  # whole
    decode: Callable[[bytes], Any]


def inbound() -> tuple[Inbound, ...]:
    """Return all inbound topics that carry a message."""
    control = ControlFrame(1, 7, 90, Control(0.25, 0.5, 0.0, Button.USE_ITEM))
    pose = PoseFrame(1, 7, 3, Pose(99, 1.0, 2.0, 0.5, 3.0, deviation=0.1, quality=0.9))
    act = encode_act(SeatAct(3, 12345))
    decision = encode_decision(Decision("0" * 32, "penalty", 3, 5.0, 1 << 40, "mallory"))
    return (
        Inbound(topics.CONTROL, encode_control(control), decode_control),
        Inbound(topics.POSE, encode_pose(pose), decode_pose),
        Inbound(topics.JOIN, encode_join(Join("mallory", "lidar", 2, 99)), decode_join),
        Inbound(topics.READY, act, decode_seat_act),
        Inbound(topics.LEAVE, act, decode_seat_act),
        Inbound(topics.ACT, decision, decode_decision),
        Inbound(topics.ACTS, decision, decode_decision),
    )


def crafted(kind: Inbound) -> Iterator[bytes]:
    """Yield messages crafted to mislead a reader, not damaged at random."""
    sample, most = kind.sample, kind.topic.most_bytes
    yield from (b"", b"\0", sample[:4], sample[:8], sample[:11])
    yield sample + bytes(most)  # too long
    yield b"\xff" * most
    yield bytes(4) + kind.topic.identifier + bytes(most - 8)
    head = kind.topic.identifier
    for root in (4, 8, most - 4, 0x7FFFFFFC, 0xFFFFFFFC):  # a root before, at and after the end
        yield U32.pack(root) + head + bytes(most - 8)
    # Offsets that all point at one table, and a count of four billion.
    yield U32.pack(12) + head + U32.pack(4) * ((most - 8) // 4)
    for place in range(8, len(sample) - 3, 2):
        yield sample[:place] + b"\xff\xff\xff\xff" + sample[place + 4 :]
    for value in (float("nan"), float("inf"), float("-inf"), 1e38, -0.0):
        word = struct.pack("<f", value)
        for place in range(12, len(sample) - 3, 4):
            yield sample[:place] + word + sample[place + 4 :]


def mutated(sample: bytes, chance: random.Random) -> bytes:
    """Return a message cut short, with bits flipped or with hostile values in it."""
    draw = chance.random()
    if draw < 0.2:
        return sample[: chance.randrange(len(sample))]
    data = bytearray(sample)
    if draw < 0.6:
        for _ in range(chance.randint(1, 8)):
            bit = chance.randrange(8 * len(data))
            data[bit >> 3] ^= 1 << (bit & 7)
    else:
        for _ in range(chance.randint(1, 3)):
            place = chance.randrange(len(data) - 3)
            U32.pack_into(data, place, chance.choice(HOSTILE_WORDS))
    return bytes(data)


def messages_for(kind: Inbound, count: int, chance: random.Random) -> Iterator[bytes]:
    """Yield `count` hostile messages of a topic, the crafted ones first."""
    for made, message in enumerate(crafted(kind)):
        if made == count:
            return
        yield message
    for _ in range(count - sum(1 for _ in crafted(kind))):
        yield mutated(kind.sample, chance)


@dataclass
class Toll:
    """Counts of decoded messages."""

    decoded: int = 0
    accepted: int = 0  # harmless damage: the values are within their limits
    errors: Counter[str] = field(default_factory=Counter)  # by the name of their type
    worst_ns: int = 0
    worst_message: bytes = b""


def decode_all(count: int, seed: int) -> Toll:
    """Decode hostile messages, spread over all inbound topics."""
    toll, chance = Toll(), random.Random(seed)
    kinds = inbound()
    gc.collect()
    gc.disable()
    try:
        for number, kind in enumerate(kinds):
            share = count // len(kinds) + (number < count % len(kinds))
            for message in messages_for(kind, share, chance):
                _decode(kind, message, toll)
    finally:
        gc.enable()
    return toll


def _decode(kind: Inbound, message: bytes, toll: Toll) -> None:
    """Decode a message; time is CPU time of this thread, so that other load does not count."""
    begun = time.thread_time_ns()
    try:
        kind.decode(message)
    except WireError:
        spent = time.thread_time_ns() - begun
        toll.errors["WireError"] += 1
    except Exception as error:
        spent = time.thread_time_ns() - begun
        toll.errors[type(error).__name__] += 1
    else:
        spent = time.thread_time_ns() - begun
        toll.accepted += 1
    toll.decoded += 1
    if spent > toll.worst_ns:
        toll.worst_ns, toll.worst_message = spent, message
