"""Encode rows of an array as a vector of structs."""

from collections.abc import Callable
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
