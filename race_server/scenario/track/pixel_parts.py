"""Connected parts of a picture."""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from race_server.errors import TrackError

Mask = NDArray[np.bool_]
Numbers = NDArray[np.signedinteger[Any]]
MOST_RUNS = 1 << 20  # of pixels in a row


class Parts(NamedTuple):
    """The connected parts of a mask."""

    of: Numbers  # (rows, columns) part of each pixel, -1 for those outside the mask
    sizes: Numbers  # (parts,) pixels of each; zero where no part has that number


def parts_of(mask: Mask, name: object, *, diagonal: bool = False) -> Parts:
    """Return the connected parts of a mask: four neighbours are connected, or all eight.

    Parts are found by runs of pixels in a row: runs in neighbouring rows that touch get the
    smaller number of the two, until nothing changes.

    Raises:
        TrackError: too many runs; it begins with `name`.
    """
    height, width = mask.shape
    # A column that is in no part stands between the end of a row and the next row.
    flat = np.zeros(1 + height * (width + 1), np.bool_)
    flat[1:].reshape(height, width + 1)[:, :-1] = mask
    changes = np.flatnonzero(flat[1:] != flat[:-1])
    starts, ends = changes[::2], changes[1::2]
    if len(starts) > MOST_RUNS:
        raise TrackError(f"{name}: {len(starts)} runs of pixels; at most {MOST_RUNS} make a map")
    first = np.searchsorted(ends, starts + width + 1, side="left" if diagonal else "right")
    beyond = np.searchsorted(starts, ends + width + 1, side="right" if diagonal else "left")
    counts = np.maximum(beyond - first, 0)
    above = np.repeat(np.arange(len(starts)), counts)
    below = np.arange(len(above)) - np.repeat(np.cumsum(counts) - counts, counts) + first[above]
    roots = _joined(len(starts), above, below)
    parts = np.full(mask.shape, -1, np.int32)
    parts[mask] = np.repeat(roots.astype(np.int32), ends - starts)
    return Parts(parts, np.bincount(roots, ends - starts).astype(np.int64))


def _joined(count: int, above: Numbers, below: Numbers) -> Numbers:
    """Return the smallest number that each of `count` things is joined with, shape (count,)."""
    roots = np.arange(count)
    while True:
        one, other = roots[above], roots[below]
        if np.array_equal(one, other):
            return roots
        np.minimum.at(roots, np.maximum(one, other), np.minimum(one, other))
        while not np.array_equal(roots, roots[roots]):
            roots = roots[roots]
