"""The state of a batch as bytes: all worlds, or some of them.

All that changes from decision to decision lies in one block of memory, array behind array, each
with its worlds side by side. So the state of all worlds is one copy, and one world is a slice of
each array.

A state begins with a header: magic, version, length of the form's own part, worlds, and a
fingerprint of what the arrays are and of the courses they refer to. It fits every batch that was
made of the same task. Bytes from people you do not trust are not for it: numbers in them are
places in arrays.
"""

import hashlib
import struct
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from race_server.core.observation import Layout
from race_server.core.state import Bytes, World
from race_server.envs.buffers import BY_WORLD, Buffers
from race_server.envs.task import Task
from race_server.errors import ScenarioError
from race_server.scenario.race import Scenario

# 2: told apart by all that decides what numbers in it mean; 3: with the gap of each round.
MAGIC, VERSION = b"RSST", 3
HEADER = struct.Struct("<4sHHI16s")
ALIGNED = 16  # bytes

# Events are what the last decision reported, not what the next one depends on.
WORLD_ARRAYS = (
    "races",
    "rules",
    "bodies",
    "racers",
    "players",
    "turns",
    "vehicles",
    "boxes",
    "hazards",
)
SIGHT_ARRAYS = ("lidar", "radar", "radar_before", "radar_kinds", "sightings")
LOT_ARRAYS = ("parkers", "blocks", "walkers", "rooms")


@dataclass(frozen=True)
class SavedState:
    """What was read of a state."""

    worlds: int
    own: bytes  # what an interface added
    body: Bytes


class StateMemory:
    """The arrays of a batch that change, as bytes of each world."""

    def __init__(self, block: Bytes, rows: list[Bytes], beside: list[Bytes], mark: bytes) -> None:
        """Take the arrays, each (W, bytes of one world).

        block: the memory of `rows`, one behind the other; beside: arrays elsewhere; mark: tells
        states of one task from those of another.
        """
        self.block, self.rows, self.beside, self.mark = block, rows, beside, mark
        self._widths = [row.shape[1] for row in rows]
        self._width_beside = sum(row.shape[1] for row in beside)
        self._all_length = self._length(self.worlds)

    @property
    def worlds(self) -> int:
        """Number of worlds."""
        return len(self.rows[0])

    def save(self, worlds: Sequence[int] | None, own: bytes) -> bytes:
        """Return the state of some worlds, or of all. own: what an interface adds."""
        count = self._count(worlds)
        header = HEADER.pack(MAGIC, VERSION, len(own), count, self.mark)
        return b"".join((header, own, *self._body(worlds)))

    def load(self, state: bytes, worlds: Sequence[int] | None) -> bytes:
        """Put some worlds, or all, into a state; return what an interface added to it.

        Raises:
            ScenarioError: it is none, of another task or version, cut off, or of another number
                of worlds.
        """
        saved = self._read(state)
        count = self._count(worlds)
        if saved.worlds not in (1, count):
            raise ScenarioError(
                f"a saved state of {saved.worlds} worlds for {count}: save one of them, or name "
                "as many"
            )
        self._fill(saved, worlds)
        return saved.own

    def _count(self, worlds: Sequence[int] | None) -> int:
        if worlds is None:
            return self.worlds
        for w in worlds:
            if not 0 <= w < self.worlds:
                raise ScenarioError(f"world {w} of {self.worlds}: choose 0 to {self.worlds - 1}")
        return len(worlds)

    def _body(self, worlds: Sequence[int] | None) -> Iterable[bytes | memoryview]:
        """Return the bytes of some worlds, or of all, in parts to be joined."""
        if worlds is None:
            return (self.block.data, *(rows.tobytes() for rows in self.beside))
        chosen = _places(worlds)
        parts = np.zeros(self._length(len(worlds)), np.uint8)
        for there, rows in zip(self._cut(parts, len(worlds)), self._all, strict=True):
            there[...] = rows[chosen]
        return (parts.data,)

    def _fill(self, saved: SavedState, worlds: Sequence[int] | None) -> None:
        if worlds is None and saved.worlds == self.worlds:
            self.block[:] = saved.body[: len(self.block)]
            there = self._cut_beside(saved.body, len(self.block), saved.worlds)
            for part, rows in zip(there, self.beside, strict=True):
                rows[...] = part
            return
        chosen = slice(None) if worlds is None else _places(worlds)
        for part, rows in zip(self._cut(saved.body, saved.worlds), self._all, strict=True):
            rows[chosen] = part

    def _read(self, state: bytes) -> SavedState:
        try:
            magic, version, own, worlds, mark = HEADER.unpack_from(state)
        except (struct.error, TypeError) as error:
            given = f"{len(state)} bytes" if isinstance(state, bytes) else f"{state!r:.40}"
            raise ScenarioError(
                f"{given} are no saved state; take one from save_state()"
            ) from error
        if magic != MAGIC or version != VERSION:
            raise ScenarioError(
                f"a saved state of version {version} that begins with {magic!r}: this program "
                f"reads version {VERSION}; save it again"
            )
        if mark != self.mark:
            raise ScenarioError(
                "a saved state of another task: load it where courses, karts, rules, drivers, "
                "observation, action, length of a decision and level are the same"
            )
        length = self._all_length if worlds == self.worlds else self._length(worlds)
        first = HEADER.size + own
        if len(state) != first + length:
            raise ScenarioError(
                f"a saved state of {len(state)} bytes, and its worlds ({worlds}) take "
                f"{first + length}: it was cut off, or something stands behind it"
            )
        body = np.frombuffer(state, np.uint8, offset=first)
        return SavedState(worlds, bytes(state[HEADER.size : first]), body)

    def _length(self, worlds: int) -> int:
        """Return how many bytes the state of a number of worlds takes, without header."""
        block = sum(_aligned(worlds * width) for width in self._widths)
        return block + worlds * self._width_beside

    @property
    def _all(self) -> list[Bytes]:
        return self.rows + self.beside

    def _cut(self, body: Bytes, worlds: int) -> list[Bytes]:
        """Return the parts of a body, each (worlds, bytes of one world)."""
        parts, start = [], 0
        for width in self._widths:
            parts.append(_part(body, start, worlds, width))
            start = _aligned(start + worlds * width)
        return parts + self._cut_beside(body, start, worlds)

    def _cut_beside(self, body: Bytes, start: int, worlds: int) -> list[Bytes]:
        parts = []
        for row in self.beside:
            parts.append(_part(body, start, worlds, row.shape[1]))
            start += worlds * row.shape[1]
        return parts


def in_one_block(
    world: World, buffers: Buffers, beside: Sequence[Any], told_apart: str
) -> tuple[World, Buffers, StateMemory]:
    """Return a world and its buffers as views of one block of memory, and that memory.

    beside: further arrays (W, …) of the discipline, which stay where they are; told_apart: what
    tells the task from others with arrays of the same sizes.
    """
    holders: list[tuple[Any, tuple[str, ...]]] = [
        (world, WORLD_ARRAYS),
        (world.sight, SIGHT_ARRAYS),
        (world.parking, LOT_ARRAYS),
        (buffers, BY_WORLD),
    ]
    arrays = [getattr(holder, name) for holder, names in holders for name in names]
    worlds = len(buffers.rounds)
    widths = [array.nbytes // worlds for array in arrays]
    block = np.zeros(sum(_aligned(worlds * width) for width in widths), np.uint8)
    rows, views, start = [], [], 0
    for array, width in zip(arrays, widths, strict=True):
        if not width:
            views.append(array)
            continue
        row = _part(block, start, worlds, width)
        view = row.reshape(-1).view(array.dtype).reshape(array.shape)
        view[...] = array
        rows.append(row)
        views.append(view)
        start = _aligned(start + worlds * width)
    mark = hashlib.blake2b(told_apart.encode(), digest_size=16)
    mark.update(repr([(array.dtype, array.shape[1:]) for array in arrays]).encode())
    mark.update(repr([(array.dtype, array.shape[1:]) for array in beside]).encode())
    there = iter(views)
    world, sight, parking, buffers = (
        holder._replace(**{name: next(there) for name in names}) for holder, names in holders
    )
    elsewhere = [array.reshape(worlds, -1).view(np.uint8) for array in beside]
    return (
        world._replace(sight=sight, parking=parking),
        buffers,
        StateMemory(block, rows, elsewhere, mark.digest()),
    )


def own_part_in(options: Mapping[str, Any] | None) -> bytes:
    """Return what an interface added to the state in the options of a reset, which was loaded."""
    state = (options or {}).get("state")
    if not state:
        return b""
    _, _, length, _, _ = HEADER.unpack_from(state)
    return state[HEADER.size : HEADER.size + length]


def told_apart_by(task: Task, scenarios: Sequence[Scenario], layout: Layout) -> str:
    """Return what tells tasks apart: all that decides what the numbers in a state mean.

    Rewards are left out: what an episode has earned so far goes on under others.
    """
    courses = [
        (
            scenario.course.name,
            scenario.course.digest,
            hashlib.blake2b(scenario.course.line.tobytes()).hexdigest(),
            scenario.rules,
            scenario.vehicles,
            scenario.level,
        )
        for scenario in scenarios
    ]
    drivers = [each if isinstance(each, str) else type(each).__name__ for each in task.opponents]
    settings = sorted(task.discipline.settings.items())
    parts = layout.numbers, layout.size, task.action, task.base, task.decision_ticks
    return repr((courses, drivers, settings, parts))


def _aligned(size: int) -> int:
    return -(-size // ALIGNED) * ALIGNED


def _places(worlds: Sequence[int]) -> Any:
    """Return what picks some worlds of an array; one of them without a copy."""
    return slice(worlds[0], worlds[0] + 1) if len(worlds) == 1 else list(worlds)


def _part(body: Bytes, start: int, worlds: int, width: int) -> Bytes:
    return body[start : start + worlds * width].reshape(worlds, width)
