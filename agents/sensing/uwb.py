"""Ranges to radio beacons from the bytes of a tag that answers as the DWM1001 does.

A frame is a row of type, length, value: 0x40 status, 0x41 place, 0x49 ranges. Of 0x49: the count,
and for each anchor its address (2 bytes), distance [mm] (4), quality [%] (1) and place (x, y, z
[mm], 4 each, and a quality), all little-endian.
"""

import math
import struct
from collections.abc import Iterator
from dataclasses import dataclass

from race_agents.unit.readings import Range

STATUS, PLACE, RANGES = 0x40, 0x41, 0x49
ANCHOR = struct.Struct("<HIBiiiB")
# Deviation [m] of a range of full quality; one of quality q is wider by 1/√q.
DEVIATION = 0.1
LEAST_QUALITY = 5  # [%] worse ranges are dropped
MOST_M = 200.0
MILLI = 1e-3


@dataclass
class UwbReader:
    """A tag's answers, as ranges in the plane."""

    height: float = 0.0  # [m] of the tag over the plane in which anchors are measured
    damaged: int = 0

    def read(self, frame: bytes) -> tuple[Range, ...]:
        """Return the ranges of one answer; of one that is damaged none."""
        try:
            return tuple(self._ranges(frame))
        except (struct.error, ValueError, IndexError):
            self.damaged += 1
            return ()

    def _ranges(self, frame: bytes) -> Iterator[Range]:
        place = 0
        while place < len(frame):
            kind, length = frame[place], frame[place + 1]
            value = frame[place + 2 : place + 2 + length]
            if len(value) != length:
                raise ValueError(f"value of type {kind:#x} is cut: {len(value)} of {length} bytes")
            if kind == STATUS and value != b"\0":
                return
            if kind == RANGES:
                yield from self._anchors(value)
            place += 2 + length

    def _anchors(self, value: bytes) -> Iterator[Range]:
        if len(value) != 1 + value[0] * ANCHOR.size:
            raise ValueError(f"{value[0]} anchors do not take {len(value)} bytes")
        for number in range(value[0]):
            row = ANCHOR.unpack_from(value, 1 + number * ANCHOR.size)
            far, quality, z = MILLI * row[1], row[2], MILLI * row[5]
            if quality < LEAST_QUALITY or far > MOST_M:
                continue
            # The way in the plane: the beacon hangs higher than the tag.
            square = far * far - (z - self.height) ** 2
            if square > 0.0:
                plane = math.sqrt(square)
                # Near below a beacon a little more of the range is much more of the way.
                spread = DEVIATION / math.sqrt(min(quality, 100) / 100.0) * far / plane
                yield Range(MILLI * row[3], MILLI * row[4], plane, spread)
