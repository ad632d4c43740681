"""A reader of FlatBuffers that checks every step, since the library for Python has no verifier.

For any bytes the result is a value within bounds or a `WireError`, in a time bounded by the size
of the message.
"""

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from race_server.errors import Reason, WireError
from race_server.printable import fault_of_name

# Numbers as they stand in a buffer.
U8, U16, U32, U64 = (struct.Struct(f"<{code}") for code in "BHIQ")
I16, I32, I64 = (struct.Struct(f"<{code}") for code in "hiq")
F32, F64 = struct.Struct("<f"), struct.Struct("<d")

# Characters of the name of a driver or a steward, and the most bytes that one takes in UTF-8.
MOST_NAME, UTF8_BYTES = 32, 4
# Bytes of a name in messages and recordings of any version; its first `MOST_NAME` characters stay.
NAME_BYTES = 256


@dataclass(frozen=True, slots=True)
class Table:
    """A table inside a message. Slots count the schema's fields from 0."""

    data: bytes
    position: int
    vtable: int
    vtable_size: int
    size: int  # of the table itself

    def field(self, slot: int, size: int) -> int:
        """Return the position of a field of `size` bytes, 0 if it is missing.

        Raises:
            WireError: it lies outside its table.
        """
        entry = 4 + 2 * slot
        if entry + 2 > self.vtable_size:
            return 0
        offset = int(U16.unpack_from(self.data, self.vtable + entry)[0])
        if offset == 0:
            return 0
        if offset + size > self.size:
            raise WireError(f"field {slot} lies outside its table")
        return self.position + offset

    def packed(self, slot: int, layout: struct.Struct, what: str) -> tuple[Any, ...]:
        """Return the numbers of a struct. what: it is, in the error.

        Raises:
            WireError: it is missing, or lies outside its table.
        """
        place = self.field(slot, layout.size)
        if place == 0:
            raise WireError(f"{what} is missing")
        return layout.unpack_from(self.data, place)

    def scalar(self, slot: int, layout: struct.Struct) -> int:
        """Return an integer, 0 if it is missing."""
        place = self.field(slot, layout.size)
        return int(layout.unpack_from(self.data, place)[0]) if place else 0

    def number(self, slot: int, layout: struct.Struct) -> float:
        """Return a finite number, 0 if it is missing.

        Raises:
            WireError: it is not finite.
        """
        place = self.field(slot, layout.size)
        value = float(layout.unpack_from(self.data, place)[0]) if place else 0.0
        if not math.isfinite(value):
            raise WireError(f"field {slot} is {value}")
        return value

    def vector(self, slot: int, item_size: int, most: int) -> tuple[int, int]:
        """Return first byte and count of a vector of at most `most` items.

        Raises:
            WireError: it is missing, longer, or leaves the message.
        """
        place = self.field(slot, 4)
        if place == 0:
            raise WireError(f"field {slot} is missing")
        place += int(U32.unpack_from(self.data, place)[0])
        if place + 4 > len(self.data):
            raise WireError(f"field {slot} leaves the message")
        count = int(U32.unpack_from(self.data, place)[0])
        if count > most:
            raise WireError(f"field {slot} has {count} items; at most {most} are allowed")
        if place + 4 + count * item_size > len(self.data):
            raise WireError(f"field {slot} of {count} items leaves the message")
        return place + 4, count

    def text(self, slot: int, most: int) -> str:
        """Return a string of at most `most` bytes.

        Raises:
            WireError: it is missing, longer, or not UTF-8.
        """
        first, count = self.vector(slot, 1, most)
        try:
            return self.data[first : first + count].decode()
        except UnicodeDecodeError as error:
            raise WireError(f"field {slot} is not UTF-8 text") from error

    def name(self, slot: int, *, least: int = 1) -> str:
        """Return a name of `least` to `MOST_NAME` characters that can be seen.

        Raises:
            WireError: it is missing, longer, not UTF-8, or part of it cannot be seen.
        """
        name = self.text(slot, MOST_NAME * UTF8_BYTES)
        fault = fault_of_name(name) if name else ""
        if fault or not least <= len(name) <= MOST_NAME:
            has = f" has {fault}" if fault else ""
            raise WireError(f"name {name!r}{has}: use {least} to {MOST_NAME} printable characters")
        return name

    def texts(self, slot: int, most: int) -> tuple[str, ...]:
        """Return a vector of at most `most` strings, together no longer than the message.

        Raises:
            WireError: it is missing, longer, leaves the message, or one is not UTF-8. Offsets may
                point at one string again and again: that is longer than the message, too.
        """
        first, count = self.vector(slot, U32.size, most)
        found, left = [], len(self.data)
        for place in range(first, first + U32.size * count, U32.size):
            begin = place + int(U32.unpack_from(self.data, place)[0])
            if begin + U32.size > len(self.data):
                raise WireError(f"a text of field {slot} leaves the message")
            size = int(U32.unpack_from(self.data, begin)[0])
            begin, left = begin + U32.size, left - size
            if left < 0 or begin + size > len(self.data):
                raise WireError(f"the texts of field {slot} leave the message")
            try:
                found.append(self.data[begin : begin + size].decode())
            except UnicodeDecodeError as error:
                raise WireError(f"field {slot} is not UTF-8 text") from error
        return tuple(found)

    def table(self, slot: int) -> "Table | None":
        """Return a table in a field, None where it is missing.

        Raises:
            WireError: it leaves the message.
        """
        place = self.field(slot, U32.size)
        if not place:
            return None
        return _table_at(self.data, place + int(U32.unpack_from(self.data, place)[0]))

    def tables(self, slot: int, most: int) -> Iterator["Table"]:
        """Yield the tables of a vector of at most `most`.

        Raises:
            WireError: it is missing, longer, or one leaves the message.
        """
        first, count = self.vector(slot, U32.size, most)
        for place in range(first, first + U32.size * count, U32.size):
            yield _table_at(self.data, place + int(U32.unpack_from(self.data, place)[0]))


def root_of(data: bytes, identifier: bytes, most: int) -> Table:
    """Return the root table of a message of at most `most` bytes.

    Raises:
        WireError: too long, too short, another kind of message, or damaged.
    """
    size = len(data)
    if size > most:
        raise WireError(f"message of {size} bytes; at most {most} are allowed", Reason.OVERSIZED)
    if size < 12:
        raise WireError(f"message of {size} bytes is too short")
    if data[4:8] != identifier:
        raise WireError(f"message is {data[4:8]!r}, expected {identifier!r}", Reason.FOREIGN)
    position = int(U32.unpack_from(data, 0)[0])
    if position < 8:
        raise WireError("root leaves the message")
    return _table_at(data, position)


def _table_at(data: bytes, position: int) -> Table:
    size = len(data)
    if position + 4 > size:
        raise WireError("a table leaves the message")
    vtable = position - int(I32.unpack_from(data, position)[0])
    if vtable < 8 or vtable + 4 > size:
        raise WireError("vtable leaves the message")
    vtable_size = int(U16.unpack_from(data, vtable)[0])
    table_size = int(U16.unpack_from(data, vtable + 2)[0])
    if vtable_size < 4 or vtable + vtable_size > size or position + table_size > size:
        raise WireError("table leaves the message")
    return Table(data, position, vtable, vtable_size, table_size)
