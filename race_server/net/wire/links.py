"""How the drivers of a race are heard, for everybody who watches: written and read."""

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
        ("", "V3"),  # up to the next multiple of four
    ]
)
MOST_LINKS = 64

Rows = NDArray[Any]


@dataclass(frozen=True, slots=True)
class LinksFrame:
    """How old it is what the drivers said last."""

    epoch: int
    tick: int
    links: Rows  # LINK


def encode_links(frame: LinksFrame) -> bytes:
    """Return how drivers are heard as a message."""
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
    """Return how drivers are heard, from a message.

    Raises:
        WireError: damaged or foreign.
    """
    table = root_of(data, topics.LINKS.identifier, topics.LINKS.most_bytes)
    first, count = table.vector(2, LINK.itemsize, MOST_LINKS)
    rows = np.frombuffer(data, LINK, count, first)
    return LinksFrame(table.scalar(0, U32), table.scalar(1, U32), rows)
