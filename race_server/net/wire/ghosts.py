"""Encode and decode the laps that spectators see a driver drive against."""

from dataclasses import dataclass

import flatbuffers
import numpy as np
from numpy.typing import NDArray

from race_server.errors import WireError
from race_server.net.wire import topics
from race_server.net.wire.generated.spectate import Ghost, Ghosts
from race_server.net.wire.rows import build_vector
from race_server.net.wire.strict import I64, MOST_NAME, U8, U16, U32, UTF8_BYTES, Table, root_of

# The best of all, and that of the team itself.
MOST_GHOSTS = 2
# Ten minutes at 20 Hz.
MOST_SAMPLES = 12_000
# A team may be a name with a number before it, and one behind.
_MOST_TEAM = 2 * MOST_NAME * UTF8_BYTES

Floats = NDArray[np.float32]


@dataclass(frozen=True, slots=True, eq=False)
class GhostFrame:
    """A lap, or all of an attempt, as N samples."""

    team: str
    seat: int
    is_best: bool  # of all; else the own best of the team that drives
    from_lights: bool  # it begins with the lights, else at the timing line
    time_us: int
    time: Floats  # (N,) [s] since its beginning
    x: Floats  # (N,) [m] centre of gravity
    y: Floats  # (N,) [m]
    distance: Floats  # (N,) [m] along the centre line from the timing line, over all laps


_SAMPLES = ("time", "x", "y", "distance")


def encode_ghosts(epoch: int, ghosts: tuple[GhostFrame, ...]) -> bytes:
    """Return ghosts as a message; of one that is longer than ten minutes the beginning."""
    builder = flatbuffers.Builder(1024)
    offsets = []
    for ghost in ghosts:
        vectors = [
            builder.CreateNumpyVector(
                np.ascontiguousarray(getattr(ghost, name)[:MOST_SAMPLES], "<f4")
            )
            for name in _SAMPLES
        ]
        team = builder.CreateString(ghost.team)
        Ghost.Start(builder)
        Ghost.AddTeam(builder, team)
        Ghost.AddSeat(builder, ghost.seat)
        Ghost.AddIsBest(builder, ghost.is_best)
        Ghost.AddFromLights(builder, ghost.from_lights)
        Ghost.AddTimeUs(builder, ghost.time_us)
        for name, vector in zip(_SAMPLES, vectors, strict=True):
            getattr(Ghost, f"Add{name.capitalize()}")(builder, vector)
        offsets.append(Ghost.End(builder))
    rows = build_vector(builder, offsets)
    Ghosts.Start(builder)
    Ghosts.AddEpoch(builder, epoch)
    Ghosts.AddGhosts(builder, rows)
    builder.Finish(Ghosts.End(builder), topics.GHOSTS.identifier)
    return bytes(builder.Output())


def decode_ghosts(data: bytes) -> tuple[int, tuple[GhostFrame, ...]]:
    """Return the epoch and the ghosts of a message.

    Raises:
        WireError: damaged, foreign, or a sample that is not finite.
    """
    table = root_of(data, topics.GHOSTS.identifier, topics.GHOSTS.most_bytes)
    ghosts = tuple(_ghost_of(one) for one in table.tables(1, MOST_GHOSTS))
    return table.scalar(0, U32), ghosts


def _ghost_of(table: Table) -> GhostFrame:
    vectors = []
    for slot in range(5, 9):
        first, count = table.vector(slot, 4, MOST_SAMPLES)
        vectors.append(np.frombuffer(table.data, "<f4", count, first))
    if len({len(values) for values in vectors}) > 1 or not np.isfinite(vectors).all():
        raise WireError("a ghost has samples that are not finite, or not as many of each kind")
    return GhostFrame(
        table.text(0, _MOST_TEAM),
        table.scalar(1, U16),
        bool(table.scalar(2, U8)),
        bool(table.scalar(3, U8)),
        table.scalar(4, I64),
        *vectors,
    )
