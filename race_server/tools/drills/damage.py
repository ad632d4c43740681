"""Damaged and crafted messages, and how decoders take them."""

import os
import random
import struct
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import islice
from pathlib import Path
from typing import Any

from race_server.tools.drills.decoders import MOST_MADE, Decoder, decoders

# Values at which readers of offsets and counts fail.
HOSTILE_WORDS = (0, 1, 4, 0x7FFF, 0x8000, 0xFFFF, 0x7FFFFFFF, 0x80000000, 0xFFFFFFF0, 0xFFFFFFFF)
U32 = struct.Struct("<I")
# A message that takes longer is decoded again, as often, and the least time counts: other work of
# the machine makes no message slow twice.
SLOW_NS, TRIES = 500_000, 4
# Messages of a decoder after which its memory is measured for the first time.
WARM_UP = 2000


def crafted(kind: Decoder) -> Iterator[bytes]:
    """Yield messages crafted to mislead a reader, not damaged at random."""
    sample, most = kind.sample, min(kind.most_bytes, MOST_MADE)
    yield from kind.crafted
    yield from (b"", b"\0", sample[:4], sample[:8], sample[:11])
    yield sample + bytes(kind.most_bytes)  # too long
    yield b"\xff" * most
    yield bytes(4) + kind.identifier + bytes(most - 8)
    head = kind.identifier
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


def messages_for(kind: Decoder, count: int, chance: random.Random) -> Iterator[bytes]:
    """Yield `count` hostile messages of a decoder, the crafted ones first."""
    made = 0
    for message in islice(crafted(kind), count):
        made += 1
        yield message
    for _ in range(count - made):
        yield mutated(kind.sample, chance)


@dataclass
class Toll:
    """Counts of the messages of one decoder."""

    decoder: str
    refuses: str  # the type of the error by which it refuses
    decoded: int = 0
    accepted: int = 0  # harmless damage: the values are within their limits
    errors: Counter[str] = field(default_factory=Counter)  # by the name of their type
    worst_ns: int = 0
    worst_message: bytes = b""
    growth_bytes: int = 0  # of this process's memory, from its first messages to the last

    def as_row(self) -> dict[str, Any]:
        """Return the figures as plain data."""
        return {
            "decoder": self.decoder,
            "messages": self.decoded,
            "refused": sum(self.errors.values()),
            "accepted": self.accepted,
            "worst_ms": round(self.worst_ns / 1e6, 3),
            "exceptions": ", ".join(sorted(self.errors)),
            "growth_mb": round(self.growth_bytes / 1e6, 1),
        }


def decode_all(count: int, seed: int) -> list[Toll]:
    """Decode hostile messages, spread over all decoders."""
    kinds, tolls = decoders(), []
    for number, kind in enumerate(kinds):
        share = count // len(kinds) + (number < count % len(kinds))
        tolls.append(toll_of(kind, share, seed + number))
    return tolls


def toll_of(kind: Decoder, count: int, seed: int) -> Toll:
    """Decode hostile messages of one decoder."""
    toll, memory = Toll(kind.name, kind.refuses.__name__), 0
    for message in messages_for(kind, count, random.Random(seed)):
        _decode(kind, message, toll)
        if toll.decoded == WARM_UP:
            memory = _memory_bytes()
    if memory:
        toll.growth_bytes = max(_memory_bytes() - memory, 0)
    return toll


def _decode(kind: Decoder, message: bytes, toll: Toll) -> None:
    spent, error = _timed(kind, message)
    for _ in range(TRIES if spent > SLOW_NS else 0):
        spent = min(spent, _timed(kind, message)[0])
    toll.decoded += 1
    if error:
        toll.errors[error] += 1
    else:
        toll.accepted += 1
    if spent > toll.worst_ns:
        toll.worst_ns, toll.worst_message = spent, message


def _timed(kind: Decoder, message: bytes) -> tuple[int, str]:
    """Decode a message; return the CPU time of this thread [ns] and the type of the error."""
    begun, error = time.thread_time_ns(), ""
    try:
        kind.decode(message)
    except Exception as problem:
        error = type(problem).__name__
    return time.thread_time_ns() - begun, error


def _memory_bytes() -> int:
    """Return the memory of this process that is resident."""
    pages = Path("/proc/self/statm").read_text().split()[1]
    return int(pages) * os.sysconf("SC_PAGE_SIZE")
