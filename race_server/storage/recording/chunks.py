"""The records of a recording's file, and the messages of a chunk, within bounds.

A recording may come from anywhere. What a length or a size claims is compared with what is there
before anything is reserved for it, a chunk is unpacked no further than it may be long, and it may
hold only as many records as its bytes could honestly tell of.
"""

import struct
import zlib
from collections.abc import Iterator
from io import BufferedReader
from typing import NamedTuple

import zstandard
from mcap.opcode import Opcode

from race_server.errors import RecordingError

MAGIC = b"\x89MCAP0\r\n"
# A chunk of ours is 64 KiB and one message, of which the beginning of a race is the longest.
MOST_RECORD = 1 << 25
# Bytes and records that a chunk may hold for each byte that it has in the file. Ours hold 20 bytes
# and a twentieth of a record.
MOST_GROWTH, FREE_BYTES = 64, 1 << 18
BYTES_PER_RECORD, FREE_RECORDS = 4, 64

# Code and length of a record.
HEAD = struct.Struct("<BQ")
# First and last time of a chunk's messages [ns], size when unpacked, CRC, length of a word.
CHUNK = struct.Struct("<QQQII")
# Channel, sequence, time [ns], time of publishing.
MESSAGE = struct.Struct("<HIQQ")
# Channel, schema, length of the topic.
CHANNEL = struct.Struct("<HHI")
U64 = struct.Struct("<Q")
ENDS = (Opcode.DATA_END, Opcode.FOOTER)


class Place(NamedTuple):
    """Where a record lies in a file, without its head."""

    opcode: int
    offset: int
    length: int


class Channel(NamedTuple):
    """A channel begins: messages of this number belong to the topic."""

    number: int
    topic: str


class Message(NamedTuple):
    """A message as it lies in the file."""

    channel: int
    time_ns: int
    data: bytes


Record = Channel | Message


def places_in(file: BufferedReader, size: int) -> Iterator[Place]:
    """Yield all whole records of a file of `size` bytes; the last is an end, unless it is torn.

    Raises:
        RecordingError: it is not MCAP.
    """
    file.seek(0)
    if file.read(len(MAGIC)) != MAGIC:
        raise RecordingError("it is not MCAP")
    at = len(MAGIC)
    while at + HEAD.size <= size:
        file.seek(at)
        head = file.read(HEAD.size)
        if len(head) < HEAD.size:
            return
        opcode, length = HEAD.unpack(head)
        begin, at = at + HEAD.size, at + HEAD.size + length
        if at > size or length > MOST_RECORD or opcode == 0:
            return
        yield Place(opcode, begin, length)
        if opcode in ENDS:
            return


def records_at(file: BufferedReader, place: Place) -> list[Record]:
    """Return the channels and messages of a record, those of a chunk in order.

    Raises:
        RecordingError: it is damaged.
    """
    if place.opcode not in {Opcode.CHUNK, Opcode.CHANNEL, Opcode.MESSAGE}:
        return []
    file.seek(place.offset)
    data = file.read(place.length)
    if place.opcode == Opcode.CHUNK:
        return read_chunk(data)
    record = _record(place.opcode, data)
    return [record] if record else []


def read_chunk(data: bytes) -> list[Record]:
    """Return the channels and messages of a chunk, in order.

    Raises:
        RecordingError: it is damaged, or holds more than a chunk of a race could.
    """
    unpacked, packed_bytes = _unpacked(data)
    most = FREE_RECORDS + packed_bytes // BYTES_PER_RECORD
    records: list[Record] = []
    count = at = 0
    while at < len(unpacked):
        count += 1
        if count > most:
            raise RecordingError(f"a chunk of {packed_bytes} bytes has more than {most} records")
        opcode, length = _unpack(HEAD, unpacked, at)
        at += HEAD.size
        if opcode == 0 or length > len(unpacked) - at:
            raise RecordingError("a record leaves its chunk")
        record = _record(opcode, unpacked[at : at + length])
        if record:
            records.append(record)
        at += length
    return records


def _record(opcode: int, data: bytes) -> Record | None:
    if opcode == Opcode.MESSAGE:
        channel, _, time_ns, _ = _unpack(MESSAGE, data)
        return Message(channel, time_ns, data[MESSAGE.size :])
    if opcode == Opcode.CHANNEL:
        number, _, length = _unpack(CHANNEL, data)
        return Channel(number, _text(data, CHANNEL.size, length))
    return None


def _unpacked(data: bytes) -> tuple[bytes, int]:
    """Return what a chunk holds, and how many bytes it takes in the file."""
    _, _, size, crc, length = _unpack(CHUNK, data)
    compression = _text(data, CHUNK.size, length)
    begin = CHUNK.size + length + U64.size
    packed = data[begin:]
    if _unpack(U64, data, begin - U64.size)[0] != len(packed):
        raise RecordingError("a chunk has another length than it says")
    if size > min(FREE_BYTES + MOST_GROWTH * len(packed), MOST_RECORD):
        raise RecordingError(f"a chunk of {len(packed)} bytes would unpack to {size} bytes")
    unpacked = _decompress(packed, size, compression)
    if len(unpacked) != size:
        raise RecordingError(f"a chunk does not unpack to the {size} bytes that it says")
    if crc and zlib.crc32(unpacked) != crc:
        raise RecordingError("a chunk has another checksum than it says")
    return unpacked, len(packed)


def _decompress(packed: bytes, size: int, compression: str) -> bytes:
    """Return what was compressed, at most one byte more than `size`."""
    try:
        if compression == "zstd":
            unpacker = zstandard.ZstdDecompressor(max_window_size=MOST_RECORD)
            return bytes(unpacker.stream_reader(packed).read(size + 1))
    except zstandard.ZstdError as error:
        raise RecordingError(f"a chunk cannot be unpacked: {str(error)[:80]}") from error
    if compression:
        raise RecordingError(f"a chunk is compressed by {compression[:20]!r}; only zstd is read")
    return packed


def _unpack(layout: struct.Struct, data: bytes, at: int = 0) -> tuple[int, ...]:
    if at + layout.size > len(data):
        raise RecordingError("a record is cut short")
    return layout.unpack_from(data, at)


def _text(data: bytes, at: int, length: int) -> str:
    try:
        if length <= len(data) - at:
            return data[at : at + length].decode()
    except UnicodeDecodeError as error:
        raise RecordingError("a name is not UTF-8") from error
    raise RecordingError("a record is cut short")
