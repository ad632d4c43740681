"""What stands and moves around a plant, as spectators are told: passed on to its body."""

from collections.abc import Callable

import numpy as np

from race_agents.plant.radar import Floats
from race_agents.plant.sight import Seen
from race_agents.unit.mailbox import Mailbox
from race_server.core.messages import KartFlag, Status
from race_server.errors import WireError
from race_server.net.wire.parking import LotFrame, decode_lot
from race_server.net.wire.spectate import SnapshotFrame, decode_snapshot
from race_server.scenario.track.polyline import corners_of_box, segments_of


class Scene:
    """The game's side: passes on the other karts of a race; in a car park also people and blocks.

    take_snapshot, take_lot: return the newest message, None where there is none.
    """

    def __init__(
        self,
        own: int,
        mailbox: Mailbox,
        take_snapshot: Callable[[], bytes | None],
        take_lot: Callable[[], bytes | None] | None,
    ) -> None:
        """Begin with nothing. own: the seat of the plant; take_lot: only in a car park."""
        self._own, self._mailbox = own, mailbox
        self._take_snapshot, self._take_lot = take_snapshot, take_lot
        self._blocks = np.zeros((0, 4))

    def turn(self, now_s: float) -> None:
        """Pass on what is new."""
        snapshot = self._take_snapshot()
        try:
            if self._take_lot is not None and (lot := self._take_lot()) is not None:
                self._blocks = _sides_of(decode_lot(lot))
            if snapshot is not None:
                seen = self._seen(decode_snapshot(snapshot))
                self._mailbox.write(seen.pack(), now_s)
        except WireError:
            return  # the next one comes in a sixtieth of a second

    def _seen(self, frame: SnapshotFrame) -> Seen:
        karts, is_lot = frame.karts, self._take_lot is not None
        own = karts[karts["seat"] == self._own]
        place = np.stack([own["x"], own["y"], own["heading"]], axis=1).astype(np.float64)
        there = (karts["seat"] != self._own) & (karts["flags"] & KartFlag.SUSPENDED == 0)
        people = np.zeros((0, 3))
        if is_lot:
            rows = [(one["x"], one["y"], one["radius"]) for one in frame.walkers]
            people = np.array(rows, np.float64).reshape(-1, 3)
        else:  # in a car park a vehicle that is done stands like a block
            there &= karts["status"] == Status.RACING
        karts = karts[there]
        cos, sin = np.cos(karts["heading"]), np.sin(karts["heading"])
        vx = karts["speed"] * cos - karts["lateral_speed"] * sin
        vy = karts["speed"] * sin + karts["lateral_speed"] * cos
        others = np.stack([karts["x"], karts["y"], karts["heading"], vx, vy], axis=1)
        return Seen(others.astype(np.float64), people, self._blocks, place)


def _sides_of(frame: LotFrame) -> Floats:
    """Return the sides of what was drawn for a round, (n, 4)."""
    sides = [
        segments_of(corners_of_box(*(float(block[name]) for name in _BOX)))
        for block in frame.blocks
    ]
    return np.concatenate([np.zeros((0, 4)), *sides])


_BOX = ("x", "y", "heading", "length", "width")
