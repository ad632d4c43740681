"""One message of each kind, with numbers that can be told apart."""

import numpy as np

from race_server.core.driver import Briefing
from race_server.core.messages import (
    Cleanness,
    Event,
    EventKind,
    Flag,
    Phase,
    Standing,
    Status,
)
from race_server.core.vehicles import TT02
from race_server.net.wire import lobby, spectate


def snapshot(karts: int = 3, hazards: int = 2) -> spectate.SnapshotFrame:
    rows = np.zeros(karts, spectate.KART)
    for number, name in enumerate(spectate.KART.names or ()):
        rows[name] = np.arange(karts) + number
    placed = np.zeros(hazards, spectate.HAZARD)
    placed["x"] = 1.5
    return spectate.SnapshotFrame(
        7, 2, 600, 0.5, Phase.RUNNING, Flag.YELLOW, rows, np.array([1, 0, 1], np.uint8), placed
    )


EVENTS = [
    Event(1, 60, EventKind.LAP, 3, 2, 17_000_000, Cleanness.UNCLEAN),
    Event(2, 61, EventKind.GREEN, -1, -1, 0),
]

STANDING = Standing(4, "me", 1, 3, Status.FINISHED, 10, 9, 30, 0, 1, 5_000_000, 2, (11, 10, 9))

STANDINGS = spectate.StandingsFrame(1, 600, 180, Phase.RUNNING, Flag.GREEN, 3, "oval", (STANDING,))

WELCOME = lobby.Welcome(Briefing(1, TT02, 3, "lidar", 0.05, ("boost", "oil"), 3.5), 99, 2, 201)
