"""Read messages of Protocol Buffers strictly: what a table does not name is refused.

Every length is compared with what is there, the fields are counted, and nothing is copied, so that
time and memory are bounded by the size of the file, whatever it holds.
"""

import struct
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any, NamedTuple

MOST_FIELDS = 1 << 16  # of all messages of a file together
MOST_VARINT_BYTES = 10
U64 = 1 << 64
F32 = struct.Struct("<f")

Fields = dict[str, list[Any]]


class DamageError(Exception):
    """A message is cut short, or holds what it must not hold."""


class Kind(Enum):
    """How a field is written, by the wire type of its values; a refused one has none."""

    INT = 0
    BYTES = 2  # of a text, numbers, or another message
    FLOAT = 5
    REFUSED = -1


class Field(NamedTuple):
    """One line of a table: what a field number stands for."""

    name: str
    kind: Kind = Kind.BYTES
    is_repeated: bool = False


Table = Mapping[int, Field]


@dataclass
class Reader:
    """Reads the messages of one file."""

    fields_left: int = MOST_FIELDS

    def read(self, data: memoryview, table: Table) -> Fields:
        """Return the values of a message by the name of their field; no list where it has none.

        Raises:
            DamageError: it is cut short, or holds a field twice or one that the table lacks.
        """
        found: Fields = {}
        place = 0
        while place < len(data):
            self._count()
            tag, place = _varint(data, place)
            number, wire = tag >> 3, tag & 7
            field = table.get(number)
            if field is None or field.kind is Kind.REFUSED:
                raise DamageError(f"holds {field.name if field else f'field {number}'}")
            values = found.setdefault(field.name, [])
            if values and not field.is_repeated:
                raise DamageError(f"holds {field.name} twice")
            value, place = _value(data, place, wire)
            if wire == field.kind.value:
                values.append(value)
            elif field.kind is Kind.INT and field.is_repeated and wire == Kind.BYTES.value:
                values += self._packed(value)
            else:
                raise DamageError(f"holds {field.name} in a wrong form")
        return found

    def _packed(self, data: memoryview) -> list[int]:
        values, place = [], 0
        while place < len(data):
            self._count()
            value, place = _varint(data, place)
            values.append(_signed(value))
        return values

    def _count(self) -> None:
        self.fields_left -= 1
        if self.fields_left < 0:
            raise DamageError(f"holds more than {MOST_FIELDS} fields")


def text_of(value: memoryview) -> str:
    """Return a text.

    Raises:
        DamageError: it is not UTF-8.
    """
    try:
        return bytes(value).decode()
    except UnicodeDecodeError as error:
        raise DamageError("holds a text that is not UTF-8") from error


def _value(data: memoryview, place: int, wire: int) -> tuple[Any, int]:
    if wire == Kind.INT.value:
        number, place = _varint(data, place)
        return _signed(number), place
    size = F32.size
    if wire == Kind.BYTES.value:
        size, place = _varint(data, place)
    elif wire != Kind.FLOAT.value:
        raise DamageError(f"holds a value of the unknown kind {wire}")
    if size > len(data) - place:
        raise DamageError("is cut short")
    piece = data[place : place + size]
    return F32.unpack(piece)[0] if wire == Kind.FLOAT.value else piece, place + size


def _varint(data: memoryview, place: int) -> tuple[int, int]:
    value = shift = 0
    for index in range(place, min(place + MOST_VARINT_BYTES, len(data))):
        byte = data[index]
        value |= (byte & 127) << shift
        if byte < 128:
            return value % U64, index + 1
        shift += 7
    raise DamageError("is cut short")


def _signed(value: int) -> int:
    return value - U64 if value >> 63 else value
