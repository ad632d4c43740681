"""Encode and decode the links of all drivers for spectators."""

from dataclasses import dataclass
from typing import Any

import flatbuffers
import numpy as np
from numpy.typing import NDArray

from race_server.net.wire import topics
from race_server.net.wire.generated.spectate import Link, Links
from race_server.net.wire.rows import build_rows
from race_server.net.wire.strict import U32, root_of

LINK = np.dtype(
    [
        ("age", "<i4"),
        ("seat", "<u2"),
        *((name, "u1") for name in ("silence", "trust", "fault")),
        ("", "V3"),  # pads to a multiple of four
    ]
)
MOST_LINKS = 64

Rows = NDArray[Any]


@dataclass(frozen=True, slots=True)
class LinksFrame:
    """The age of the newest input of each driver."""

    epoch: int
    tick: int
    links: Rows  # LINK


def encode_links(frame: LinksFrame) -> bytes:
    """Return the links of drivers as a message."""
    builder = flatbuffers.Builder(64 + LINK.itemsize * len(frame.links))
    named = frame.links[["age", "seat", "silence", "trust", "fault"]]
    rows = build_rows(builder, Links.StartLinksVector, Link.CreateLink, named)
    Links.Start(builder)
    Links.AddEpoch(builder, frame.epoch)
    Links.AddTick(builder, frame.tick)
    Links.AddLinks(builder, rows)
    builder.Finish(Links.End(builder), topics.LINKS.identifier)
    return bytes(builder.Output())


def decode_links(data: bytes) -> LinksFrame:
    """Return the links of drivers from a message.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, topics.LINKS.identifier, topics.LINKS.most_bytes)
    first, count = table.vector(2, LINK.itemsize, MOST_LINKS)
    rows = np.frombuffer(data, LINK, count, first)
    return LinksFrame(table.scalar(0, U32), table.scalar(1, U32), rows)
