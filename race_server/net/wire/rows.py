"""Encode vectors: of structs that are rows of an array, and of tables or texts."""

from collections.abc import Callable, Sequence
from typing import Any

import flatbuffers
from numpy.typing import NDArray


def build_rows(
    builder: flatbuffers.Builder,
    start: Callable[[flatbuffers.Builder, int], object],
    create: Callable[..., object],
    rows: NDArray[Any],
) -> int:
    """Write a vector of structs and return its offset.

    start, create: of the generated code, for the vector and for one struct; rows: a structured
    array whose fields have the names and the order of the struct's.
    """
    start(builder, len(rows))
    for row in rows[::-1]:  # FlatBuffers are written backwards
        create(builder, *row.item())
    return int(builder.EndVector())


def build_vector(builder: flatbuffers.Builder, offsets: Sequence[int]) -> int:
    """Write a vector of tables or texts that are written already, and return its offset."""
    builder.StartVector(4, len(offsets), 4)
    for offset in reversed(offsets):
        builder.PrependUOffsetTRelative(offset)
    return int(builder.EndVector())
