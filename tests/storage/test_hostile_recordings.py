"""Recordings, arrays and traces that claim more than they hold."""

import io
import json
import random
import zlib
from pathlib import Path

import numpy as np
import pytest
from mcap.opcode import Opcode

from race_server.errors import RecordingError, ResultsError, WireError
from race_server.scenario.race import Scenario
from race_server.storage.arrays import read_arrays
from race_server.storage.recording.channels import SCENE, START
from race_server.storage.recording.chunks import CHUNK, MESSAGE, read_chunk
from race_server.storage.recording.reader import Line, read_lines
from race_server.storage.recording.scenario_codec import pack_scenario, unpack_scenario
from race_server.storage.recording.seekable import SeekableRecording
from race_server.storage.recording.to_json import to_json
from race_server.storage.results.queries import decode_trace
from race_server.tools.drills.bombs import (
    MEGABYTE,
    arrays_of,
    chunk,
    crowd,
    record,
    recording,
    zeros_in_zstd,
)
from support.courses import SMALL_RING

PLAIN = chunk(record(Opcode.MESSAGE, MESSAGE.pack(7, 0, 5, 5) + b"hello"), 36, "")


def test_a_chunk_holds_its_messages() -> None:
    assert read_chunk(PLAIN) == [(7, 5, b"hello")]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (chunk(zeros_in_zstd(64 * MEGABYTE), 64 * MEGABYTE), "would unpack to 67108864 bytes"),
        # What it unpacks to is bounded by what it claims, whatever its own head says.
        (chunk(zeros_in_zstd(64 * MEGABYTE), 1000), "does not unpack to the 1000 bytes"),
        (chunk(bytes(1000), 1 << 62), "would unpack to 4611686018427387904 bytes"),
        (chunk(bytes(1000), 1000, "lz4"), "compressed by 'lz4'; only zstd is read"),
        (crowd(), r"has more than \d{2,3} records"),
        (PLAIN[:-1], "has another length than it says"),
        (PLAIN[: CHUNK.size], "is cut short"),
        (chunk(b"\0" * 900, 900, ""), "a record leaves its chunk"),
    ],
)
def test_a_chunk_that_claims_too_much_is_refused(content: bytes, message: str) -> None:
    with pytest.raises(RecordingError, match=message):
        read_chunk(content)


def test_a_damaged_chunk_gives_records_or_one_kind_of_error() -> None:
    rng, refused = random.Random(3), 0
    for _ in range(3000):
        data = bytearray(PLAIN)
        data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        try:
            read_chunk(bytes(data[: rng.choice((len(data), rng.randrange(len(data))))]))
        except RecordingError:
            refused += 1
    assert 0 < refused < 3000


def test_a_bomb_ends_a_recording_like_any_damage(tmp_path: Path) -> None:
    path = tmp_path / "bomb.mcap"
    path.write_bytes(recording(chunk(zeros_in_zstd(64 * MEGABYTE), 64 * MEGABYTE)))
    assert list(read_lines(path)) == [None]
    with pytest.raises(RecordingError, match="the beginning of a race is missing"):
        SeekableRecording(path)


@pytest.mark.parametrize(
    ("packed", "message"),
    [
        (arrays_of((1 << 40, 4), b""), "does not hold float64 of shape"),
        (arrays_of((1 << 21, 8), bytes(1 << 27)), "at most 256 of 67108864 bytes"),
        (arrays_of((3, 2), bytes(48)), "line of the course is no table of 4 columns"),
        (arrays_of((3, 4), np.full((3, 4), np.nan).tobytes()), "other than finite numbers"),
        (arrays_of((40_000, 4), bytes(32 * 40_000)), "40000 rows of line; at most 16384"),
    ],
)
def test_a_course_that_no_file_could_describe_makes_no_scenario(
    packed: bytes, message: str
) -> None:
    setting, honest = pack_scenario(Scenario(SMALL_RING))
    arrays = read_arrays(io.BytesIO(honest), 1 << 26)
    try:
        arrays |= read_arrays(io.BytesIO(packed), 1 << 26)
    except ValueError:
        both = packed
    else:
        file = io.BytesIO()
        np.savez_compressed(file, allow_pickle=False, **arrays)
        both = file.getvalue()
    with pytest.raises(RecordingError, match=message):
        unpack_scenario(setting, both)


@pytest.mark.parametrize("data", [b"{", b"[" * 100_000, b"\xff"])
def test_a_message_that_is_no_json_is_a_wire_error(data: bytes) -> None:
    with pytest.raises(WireError):
        to_json(Line(SCENE, 0, data))
    with pytest.raises(WireError):
        to_json(Line(START, 0, data))


def test_a_trace_comes_back_and_a_bomb_does_not() -> None:
    numbers = zlib.compress(np.arange(6, dtype="<f4").tobytes())
    assert decode_trace('["x", "y"]', numbers)["y"].tolist() == [3.0, 4.0, 5.0]
    bomb = zlib.compress(bytes(20 * MEGABYTE), 1)
    for columns, packed in (
        ('["x"]', bomb),
        ('["x"]', b"x"),
        ("[", numbers),
        ("{}", numbers),
        (json.dumps([["x"], ["y"]]), numbers),
    ):
        with pytest.raises(ResultsError, match="is damaged"):
            decode_trace(columns, packed)
