"""What an item is: plain numbers that the compiled rules carry out."""

from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from race_server.core import codes
from race_server.core.clock import ticks_of
from race_server.core.state import ITEM as ITEM_RECORD
from race_server.core.state import Records


class Use(IntEnum):
    """What happens when a driver uses an item."""

    NONE = 0
    ON_SELF = codes.ON_SELF  # the effect acts on the user
    PLACED = codes.PLACED  # a hazard is left behind; its effect acts on each kart that touches it
    GUARD = codes.GUARD  # the next hits within the effect's time are taken without harm
    ON_KART_AHEAD = codes.ON_KART_AHEAD  # the effect acts on the next kart ahead that races on


@dataclass(frozen=True)
class Item:
    """One item and its effect.

    leader_weight, last_weight: how often the first and the last kart draw it, relative to the
    other items; places in between are interpolated. speed_scale, thrust_scale, grip_scale: what
    the effect leaves of top speed, motor force and grip; above 1 helps.
    """

    name: str
    use: Use
    leader_weight: float
    last_weight: float
    effect_s: float = 0.0
    speed_scale: float = 1.0
    thrust_scale: float = 1.0
    grip_scale: float = 1.0
    immunity_s: float = 0.0  # after a harmful effect has ended
    radius: float = 0.0  # of a placed hazard, in kart widths
    life_s: float = 0.0  # of a placed hazard
    owner_grace_s: float = 0.0  # time for which its owner may touch it without harm

    @classmethod
    def nothing(cls) -> "Item":
        """Return the item that is no item."""
        return cls("nothing", Use.NONE, 0.0, 0.0)


def item_records(items: Sequence[Item]) -> Records:
    """Return items as ITEM records, shape (items,)."""
    records = np.zeros(len(items), ITEM_RECORD)
    for record, item in zip(records, items, strict=True):
        record.use = int(item.use)
        record.effect_ticks = ticks_of(item.effect_s)
        record.immunity_ticks = ticks_of(item.immunity_s)
        record.life_ticks = ticks_of(item.life_s)
        record.owner_grace_ticks = ticks_of(item.owner_grace_s)
        for name in (
            "leader_weight",
            "last_weight",
            "speed_scale",
            "thrust_scale",
            "grip_scale",
            "radius",
        ):
            setattr(record, name, getattr(item, name))
    return records
