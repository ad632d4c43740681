"""Types of records whose fields are attributes for kernels, each eight bytes wide."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

# Arrays of records: kernels read fields as attributes, other code as `bodies["x"]`.
Records = NDArray[Any]
Record = Any  # one record: its fields are attributes


def fields_of(floats: str, ints: str) -> list[tuple[str, Any]]:
    """Return fields with a name each: numbers with a fraction, then whole ones."""
    return [
        *((name, np.float64) for name in floats.split()),
        *((name, np.int64) for name in ints.split()),
    ]


def record_of(fields: list[Any]) -> np.dtype[Any]:
    """Return the type of a record with these fields."""
    return np.dtype((np.record, fields))
