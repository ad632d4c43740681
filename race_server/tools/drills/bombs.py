"""Small files that cost a careless reader gigabytes, minutes or secrets."""

import io
import json
import math
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import zstandard
from mcap.opcode import Opcode

from race_server.storage.recording.chunks import CHUNK, HEAD, MAGIC, MESSAGE, U64

MEGABYTE = 1 << 20
YAML = "image: map.png\nresolution: 0.05\norigin: [0, 0, 0]\n"


@dataclass(frozen=True)
class Bomb:
    """A file, and the words of the command that reads it."""

    name: str
    file: str
    content: Callable[[], bytes]
    command: tuple[str, ...]  # `race` reads it with these, FILE stands for its path
    beside: bytes = b""  # of `map.png` in the same folder

    def write(self, folder: Path) -> list[str]:
        """Write the file, and return the words of the command."""
        path = folder / self.file
        path.write_bytes(self.content())
        if self.beside:
            (folder / "map.png").write_bytes(self.beside)
        places = {"FILE": str(path), "NEW": str(folder / "new.toml")}
        return [places.get(word, word) for word in self.command]


def record(opcode: int, content: bytes) -> bytes:
    """Return a record of MCAP."""
    return HEAD.pack(opcode, len(content)) + content


def chunk(packed: bytes, size: int, compression: str = "zstd") -> bytes:
    """Return the content of a chunk. size: when it is unpacked, as it claims [bytes]."""
    head = CHUNK.pack(0, 1, size, 0, len(compression)) + compression.encode()
    return head + U64.pack(len(packed)) + packed


def recording(content: bytes) -> bytes:
    """Return a recording with one chunk."""
    return MAGIC + record(Opcode.HEADER, bytes(8)) + record(Opcode.CHUNK, content)


def zeros_in_zstd(size: int) -> bytes:
    """Return a few bytes that unpack to many."""
    packer = zstandard.ZstdCompressor().compressobj(size=size)
    parts = [packer.compress(bytes(MEGABYTE)) for _ in range(size // MEGABYTE)]
    return b"".join([*parts, packer.flush()])


def crowd() -> bytes:
    """Return a chunk of 8000 empty messages."""
    messages = record(Opcode.MESSAGE, MESSAGE.pack(1, 0, 0, 0)) * 8000
    return chunk(zstandard.ZstdCompressor().compress(messages), len(messages))


def arrays_of(shape: tuple[int, ...], content: bytes) -> bytes:
    """Return an .npz file with one array that claims a shape of float64."""
    head = io.BytesIO()
    words = {"descr": "<f8", "fortran_order": False, "shape": shape}
    np.lib.format.write_array_header_1_0(head, words)
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("course.line.npy", head.getvalue() + content)
    return file.getvalue()


def picture(width: int, height: int, rows: bytes = b"") -> bytes:
    """Return a picture in PNG of one bit a pixel. rows: each begins with a zero."""

    def part(kind: bytes, data: bytes) -> bytes:
        return (
            struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        )

    head = struct.pack(">IIBBBBB", width, height, 1, 0, 0, 0, 0)
    body = part(b"IHDR", head) + part(b"IDAT", zlib.compress(rows)) + part(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + body


def stripes(side: int) -> bytes:
    """Return a picture of walls as thin as a pixel, three pixels apart."""
    return picture(side, side, (b"\0" + b"\x77" * (side // 8)) * side)


def circle(radius: float, points: int) -> list[tuple[float, float]]:
    """Return points of a circle [m]."""
    angles = [2.0 * math.pi * n / points for n in range(points)]
    return [(radius * math.cos(angle), radius * math.sin(angle)) for angle in angles]


def track(rows: list[tuple[float, float]], more: str = "") -> bytes:
    """Return a track file of a line through points."""
    points = ", ".join(f"[{x:.3f}, {y:.3f}]" for x, y in rows)
    return f'form = "line"\nscale = "kart"\nhalf_width = 4.0\npoints = [{points}]\n{more}'.encode()


def table(rows: list[tuple[float, float]]) -> bytes:
    """Return a CSV file of a centre line."""
    return "\n".join(f"{x:.3f},{y:.3f},4,4" for x, y in rows).encode()


def field(number: int, value: bytes | int) -> bytes:
    """Return a field of Protocol Buffers."""
    if isinstance(value, int):
        return _varint(number << 3) + _varint(value)
    return _varint(number << 3 | 2) + _varint(len(value)) + value


def _varint(value: int) -> bytes:
    parts = bytearray()
    while value > 127:
        parts.append(value & 127 | 128)
        value >>= 7
    return bytes([*parts, value])


def policy(nodes: bytes, constants: bytes = b"") -> bytes:
    """Return an ONNX file. nodes, constants: fields of its graph."""
    rows = field(1, field(2, b"n")) + field(1, field(1, 4))
    kind = field(2, field(1, field(1, 1) + field(2, rows)))
    graph = nodes + constants + field(11, field(1, b"observation") + kind)
    graph += field(12, field(1, b"action") + kind)
    metadata = field(14, field(1, b"race-server-policy") + field(2, json.dumps({}).encode()))
    return field(1, 8) + field(8, field(2, 17)) + field(7, graph) + metadata


def operator(name: bytes, *inputs: bytes, attribute: bytes = b"") -> bytes:
    """Return an operator that answers `action`, as a field of a graph."""
    words = b"".join(field(1, one) for one in inputs) + field(2, b"action") + field(4, name)
    return field(1, words + (field(5, attribute) if attribute else b""))


def constant(name: bytes, dims: tuple[int, ...], more: bytes) -> bytes:
    """Return a constant of float32, as a field of a graph."""
    return field(5, b"".join(field(1, dim) for dim in dims) + field(2, 1) + field(8, name) + more)


def _elsewhere() -> bytes:
    place = field(13, field(1, b"location") + field(2, b"../../secret")) + field(14, 1)
    return policy(operator(b"MatMul", b"observation", b"w"), constant(b"w", (4, 4), place))


def _without_end() -> bytes:
    body = field(1, b"body") + field(6, field(2, b"g")) + field(20, 5)
    return policy(operator(b"Loop", b"often", b"yes", b"observation", attribute=body))


def _widened() -> bytes:
    row, column = bytes(4 * 40_000), bytes(4 * 40_000)
    constants = constant(b"r", (1, 40_000), field(9, row))
    constants += constant(b"c", (40_000, 1), field(9, column))
    return policy(operator(b"Mul", b"r", b"c"), constants)


_INFO, _CHECK = ("recording", "info", "FILE"), ("policy", "check", "FILE")
_IMPORT, _SHOW = ("track", "import", "FILE", "--to", "NEW"), ("track", "check", "FILE")

BOMBS = (
    Bomb(
        "8 kB that unpack to 256 MB", "a.mcap",
        lambda: recording(chunk(zeros_in_zstd(256 * MEGABYTE), 256 * MEGABYTE)), _INFO,
    ),
    Bomb("a chunk that claims 8 GB", "b.mcap", lambda: recording(chunk(bytes(99), 1 << 33)), _INFO),
    Bomb("8000 messages in 300 bytes", "c.mcap", lambda: recording(crowd()), _INFO),
    Bomb("a picture of 30 000 x 30 000", "m.yaml", YAML.encode, _IMPORT, picture(30_000, 30_000)),
    Bomb("4 million stripes in a map", "n.yaml", YAML.encode, _IMPORT, stripes(4000)),
    Bomb("100 MB of YAML", "o.yaml", lambda: b"a: b\n" * 20_000_000, _IMPORT),
    Bomb("a line of 100 km", "d.csv", lambda: table(circle(16e3, 400)), _IMPORT),
    Bomb("30 000 points", "e.csv", lambda: table(circle(100.0, 30_000)), _IMPORT),
    Bomb("100 MB of points", "f.csv", lambda: b"1,2,3,4\n" * 12_500_000, _IMPORT),
    Bomb("a track of 100 km", "g.toml", lambda: track(circle(16e3, 400)), _SHOW),
    Bomb(
        "300 obstacles", "h.toml",
        lambda: track(circle(50.0, 40), f"obstacles = [{'[1, 2, 3, 4, 5], ' * 300}]"), _SHOW,
    ),
    Bomb("brackets nested 100 000 deep", "i.toml", lambda: b"a = " + b"[" * 100_000, _SHOW),
    Bomb("a key of 40 000 words", "j.toml", lambda: b".".join([b"a"] * 40_000) + b" = 1", _SHOW),
    Bomb("a policy whose weights are another file", "p.onnx", _elsewhere, _CHECK),
    Bomb("a policy that repeats for ever", "q.onnx", _without_end, _CHECK),
    Bomb(
        "a policy that makes 6 GB", "r.onnx",
        lambda: policy(operator(b"ConstantOfShape", b"observation")), _CHECK,
    ),
    Bomb("a policy that multiplies row by column", "s.onnx", _widened, _CHECK),
)  # fmt: skip
