"""What stands and moves around a plant, as its simulated body learns of it: through a mailbox.

The body is on the safety side, which has no network: the game's side passes on what is there, see
`race_agents.plant.scene`, in a mailbox of the same kind as the two of the kart.
"""

import struct
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from race_agents.plant.radar import Floats, Person, Surroundings
from race_agents.unit.mailbox import Freshness, Mailbox, Memory, size_of

# Rows of other karts, people, sides of blocks, and places.
COUNTS = struct.Struct("<4I")
COLUMNS = (5, 3, 4, 3)
MOST_BYTES = 1 << 18


def _none(columns: int) -> Callable[[], Floats]:
    return lambda: np.zeros((0, columns))


@dataclass(frozen=True, eq=False)
class Seen:
    """What is there."""

    others: Floats = field(default_factory=_none(5))  # (n, 5) x, y, heading, velocity
    people: Floats = field(default_factory=_none(3))  # (n, 3) x, y, radius
    blocks: Floats = field(default_factory=_none(4))  # (n, 4) sides of what was drawn for a round
    place: Floats = field(default_factory=_none(3))  # (0 or 1, 3) where the round puts the plant

    def pack(self) -> bytes:
        """Return it as bytes."""
        tables = self.others, self.people, self.blocks, self.place
        counts = COUNTS.pack(*(len(table) for table in tables))
        return counts + b"".join(table.astype("<f8").tobytes() for table in tables)

    @staticmethod
    def unpack(data: bytes) -> "Seen":
        """Return what `pack` wrote."""
        tables, place = [], COUNTS.size
        for count, columns in zip(COUNTS.unpack_from(data), COLUMNS, strict=True):
            rows = np.frombuffer(data, "<f8", count * columns, place).reshape(count, columns)
            tables.append(rows)
            place += 8 * count * columns
        return Seen(*tables)


def mailbox_over(memory: Memory, offset: int) -> Mailbox:
    """Return the mailbox of a scene in some memory, from a byte on."""
    return Mailbox(memory, MOST_BYTES, offset)


SCENE_BYTES = size_of(MOST_BYTES)


@dataclass
class Sight:
    """The safety side: keeps a plant's surroundings as the mailbox tells them."""

    mailbox: Mailbox
    around: Surroundings
    is_lot: bool
    _fresh: Freshness = field(default_factory=Freshness)
    _place: tuple[float, float, float] | None = None
    _walls: Floats | None = None

    def look(self) -> Floats | None:
        """Return the other karts, (n, 5): x, y, heading, velocity; None if nothing is new."""
        mail = self.mailbox.read()
        if not self._fresh.note(mail, 0.0):
            return None
        assert mail is not None
        seen = Seen.unpack(mail.data)
        if len(seen.place):
            x, y, heading = seen.place[0].tolist()
            self._place = x, y, heading
        if self.is_lot:
            walls = self._walls = self.around.borders if self._walls is None else self._walls
            self.around.borders = np.concatenate([walls, seen.blocks])
            self.around.people[:] = [Person(*row) for row in seen.people.tolist()]
        return seen.others

    def find(self) -> tuple[float, float, float] | None:
        """Return where the round puts the plant: x, y, heading; None as long as none has begun."""
        if self._place is None:
            self.look()
        return self._place
