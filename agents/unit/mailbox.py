"""A mailbox in memory that two programs share: the newest whole message of one writer.

Two slots take turns, so a writer that is killed in the middle of one leaves the other one whole.
Each holds a counter, the time of writing, the length, the message, and a CRC-32 of all that: what
is half written, damaged or never written is no message. Readers never wait, and neither do writers.
"""

import struct
import zlib
from dataclasses import dataclass
from typing import Protocol

HEAD = struct.Struct("<QdI")  # counter, time [s], bytes
CRC = struct.Struct("<I")
SLOTS = 2


class Memory(Protocol):
    """Bytes that can be written in place: a bytearray, a memory map."""

    def __getitem__(self, place: slice, /) -> bytes | bytearray:
        """Return some bytes."""

    def __setitem__(self, place: slice, data: bytes, /) -> None:
        """Write some bytes of the same number."""


@dataclass(frozen=True)
class Mail:
    """A message as it was written."""

    counter: int  # of all messages, from 1 on
    time_s: float  # by the writer's clock
    data: bytes


def size_of(capacity: int) -> int:
    """Return the bytes of memory for messages of at most `capacity` bytes."""
    return SLOTS * (HEAD.size + capacity + CRC.size)


@dataclass
class Mailbox:
    """One direction: one writer, any number of readers."""

    memory: Memory
    capacity: int  # [bytes] of the longest message
    offset: int = 0  # [bytes] in the memory
    counter: int = 0  # of the newest message that was written here

    def write(self, data: bytes, time_s: float) -> None:
        """Write a message over the older one of the two."""
        assert len(data) <= self.capacity, f"{len(data)} bytes, {self.capacity} fit"
        self.counter += 1
        head = HEAD.pack(self.counter, time_s, len(data))
        whole = head + data + CRC.pack(zlib.crc32(head + data))
        place = self.place_of(self.counter)
        self.memory[place : place + len(whole)] = whole

    def read(self) -> Mail | None:
        """Return the newest whole message, None where there is none."""
        found = [mail for slot in range(SLOTS) if (mail := self._mail_in(slot)) is not None]
        return max(found, key=lambda mail: mail.counter, default=None)

    def place_of(self, counter: int) -> int:
        """Return where in the memory the message of this number begins."""
        return self.offset + (counter % SLOTS) * (HEAD.size + self.capacity + CRC.size)

    def _mail_in(self, slot: int) -> Mail | None:
        place = self.place_of(slot)
        head = bytes(self.memory[place : place + HEAD.size])
        counter, time_s, size = HEAD.unpack(head)
        if counter == 0 or size > self.capacity:
            return None
        place += HEAD.size
        rest = bytes(self.memory[place : place + size + CRC.size])
        if zlib.crc32(head + rest[:size]) != CRC.unpack_from(rest, size)[0]:
            return None
        return Mail(counter, time_s, rest[:size])


@dataclass
class Freshness:
    """How long ago the newest message with a new counter came."""

    counter: int = 0
    since_s: float = -float("inf")

    def note(self, mail: Mail | None, now_s: float) -> bool:
        """Take what was read; return whether it is new.

        A counter that stands still is silence, and an older one is what the writer has left whole
        while it writes over the newest. 64 bits never turn over.
        """
        if mail is None or mail.counter <= self.counter:
            return False
        self.counter, self.since_s = mail.counter, now_s
        return True
