"""What stands and moves around a plant: as spectators are told, and seen only by its sensors."""

import numpy as np

from race_agents.plant.radar import Floats, Person, Surroundings
from race_server.core.messages import KartFlag, Status
from race_server.errors import WireError
from race_server.net.transport import ClientLink, Mailbox
from race_server.net.wire import topics
from race_server.net.wire.parking import LotFrame, decode_lot
from race_server.net.wire.spectate import SnapshotFrame, decode_snapshot
from race_server.scenario.track.polyline import corners_of_box, segments_of


class Scene:
    """The other karts of a race; in a car park also people, and what was drawn for the round."""

    def __init__(self, link: ClientLink, own: int, around: Surroundings, *, is_lot: bool) -> None:
        """Begin to listen. own: the seat of the plant, whose surroundings are kept up to date."""
        self._own, self._around, self._is_lot = own, around, is_lot
        self._walls = around.borders
        self._place: tuple[float, float, float] | None = None
        self._snapshots, self._lots = Mailbox(), Mailbox()
        link.listen(topics.SNAPSHOT, self._snapshots.put)
        if is_lot:
            link.listen(topics.LOT, self._lots.put)

    def find(self) -> tuple[float, float, float] | None:
        """Return where the round puts the plant: x, y, heading; None as long as none has begun."""
        if self._place is None:
            self.look()
        return self._place

    def look(self) -> Floats | None:
        """Return the other karts, (n, 5): x, y, heading, velocity; None if nothing is new."""
        lot, snapshot = self._lots.take(0.0), self._snapshots.take(0.0)
        try:
            if lot is not None:
                self._note_blocks(decode_lot(lot))
            return None if snapshot is None else self._others(decode_snapshot(snapshot))
        except WireError:
            return None  # the next one comes in a sixtieth of a second

    def _note_blocks(self, frame: LotFrame) -> None:
        """Let what was drawn for the round stand there."""
        sides = [
            segments_of(corners_of_box(*(float(block[name]) for name in _BOX)))
            for block in frame.blocks
        ]
        self._around.borders = np.concatenate([self._walls, *sides])

    def _others(self, frame: SnapshotFrame) -> Floats:
        karts = frame.karts
        own = karts[karts["seat"] == self._own]
        if len(own):
            self._place = float(own["x"][0]), float(own["y"][0]), float(own["heading"][0])
        there = (karts["seat"] != self._own) & (karts["flags"] & KartFlag.SUSPENDED == 0)
        if not self._is_lot:  # there it stands like a block once it is done
            there &= karts["status"] == Status.RACING
        if self._is_lot:
            self._around.people[:] = [
                Person(float(one["x"]), float(one["y"]), float(one["radius"]))
                for one in frame.walkers
            ]
        karts = karts[there]
        cos, sin = np.cos(karts["heading"]), np.sin(karts["heading"])
        vx = karts["speed"] * cos - karts["lateral_speed"] * sin
        vy = karts["speed"] * sin + karts["lateral_speed"] * cos
        rows = (karts["x"], karts["y"], karts["heading"], vx, vy)
        return np.stack(rows, axis=1).astype(np.float64)


_BOX = ("x", "y", "heading", "length", "width")
