"""Arrays out of an .npz file that may come from anywhere: none is made before its size is known."""

import io
import math
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

MOST_ARRAYS = 256
# Booleans, numbers and text; no objects, which would be programs.
KINDS = "biufU"


def read_arrays(file: IO[bytes] | Path, most_bytes: int) -> dict[str, NDArray[Any]]:
    """Return the arrays of an .npz file, `most_bytes` of them at most when they are unpacked.

    Raises:
        ValueError: there are more, or one is not what its head says. A damaged file raises others,
            too.
    """
    with zipfile.ZipFile(file) as archive:
        members = archive.infolist()
        size = sum(member.file_size for member in members)
        if len(members) > MOST_ARRAYS or size > most_bytes:
            raise ValueError(
                f"{len(members)} arrays of {size} bytes; at most {MOST_ARRAYS} of {most_bytes} "
                "bytes are read"
            )
        return {member.filename.removesuffix(".npy"): _array(archive, member) for member in members}


def _array(archive: zipfile.ZipFile, member: zipfile.ZipInfo) -> NDArray[Any]:
    data = archive.read(member)
    head = io.BytesIO(data)
    version = npy.read_magic(head)
    read_head = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    shape, is_fortran, dtype = read_head(head)
    begin = head.tell()
    if dtype.kind not in KINDS or math.prod(shape) * dtype.itemsize != len(data) - begin:
        raise ValueError(f"{member.filename[:60]!r} does not hold {dtype} of shape {shape}"[:200])
    flat = np.frombuffer(data, dtype, math.prod(shape), begin)
    return flat.reshape(shape, order="F" if is_fortran else "C").copy(order="K")
