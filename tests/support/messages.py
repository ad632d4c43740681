"""One message of each kind, with numbers that can be told apart."""

from dataclasses import fields, replace

import numpy as np

from race_server.core.alert import Advice, Alert, Cause, Danger, DangerStage
from race_server.core.driver import Briefing
from race_server.core.hint import Hint, HintKind
from race_server.core.level import Level
from race_server.core.messages import (
    Cleanness,
    Ending,
    Event,
    EventKind,
    EventPhase,
    Flag,
    Merit,
    Parking,
    Phase,
    PlannedWay,
    PoseFault,
    RayHit,
    Source,
    Standing,
    Status,
    Timing,
    Trust,
)
from race_server.core.parking_order import ParkingOrder, Slot
from race_server.core.peer import Peer
from race_server.core.stint import Stint
from race_server.core.telemetry import Health, SensorState, Telemetry
from race_server.core.vehicle_presets import TT02
from race_server.net.wire import (
    drive,
    ghosts,
    line,
    links,
    lobby,
    parking,
    programme,
    rays,
    spectate,
)
from race_server.net.wire.peer import PeerFrame


def snapshot(karts: int = 3, hazards: int = 2) -> spectate.SnapshotFrame:
    rows = np.zeros(karts, spectate.KART)
    for number, name in enumerate(spectate.KART.names or ()):
        rows[name] = np.arange(karts) + number
    placed = np.zeros(hazards, spectate.HAZARD)
    placed["x"] = 1.5
    return spectate.SnapshotFrame(
        7, 2, 600, 0.5, Phase.RUNNING, Flag.YELLOW, rows, np.array([1, 0, 1], np.uint8), placed
    )


def lot_snapshot() -> spectate.SnapshotFrame:
    """Return a snapshot with two people."""
    people = np.array([(1.5, -2.5, 0.25), (0.0, 4.0, 0.5)], parking.WALKER)
    return replace(snapshot(), walkers=people)


ALERT = Alert(
    99,
    Danger(DangerStage.FULL, RayHit.PERSON, 0.25, 4.5, 0.75, 6.5, Advice.BRAKE),
    Cause.OBSTACLE | Cause.LINK,
)

TELEMETRY = Telemetry(
    *(99, 1.0, 2.0, 0.5, 3.0, 0.25, Source.BEACONS, DangerStage.EASE, Cause.SENSOR),
    Health((SensorState.WELL,) * 7 + (SensorState.SILENT,), 0.125, 0.5, 0.75),
)

# Numbers that 32 bits hold: a kart that brakes, and answers the clock of seat 3.
PEER = PeerFrame(
    4, Peer(99, 1.0, 2.0, 0.5, 3.0, 0.25, -0.5, 6.5, 0.125, 0.0625, 2.0, 1.25), 3, 1 << 40
)

# Of a lap, and help for two corners, of which the timing line lies in one.
HINT = Hint(
    *(3, 31_250_000, 1_500_000, "", HintKind.EARLY_BRAKES, "T4"),
    *(6.5, 12.0, ((20.0, 64.5), (380.0, 4.0))),
)

EVENTS = [
    Event(1, 60, EventKind.LAP, 3, 2, 17_000_000, Cleanness.UNCLEAN),
    Event(2, 61, EventKind.GREEN, -1, -1, 0),
]

STANDING = Standing(4, "me", 1, 3, Status.FINISHED, 10, 9, 30, 0, 1, 5_000_000, 2, (11, 10, 9))

PARKED = replace(
    STANDING,
    parking=Parking(Ending.PARKED, 7, 40.5, 3.25, 2, 1),
    planned=PlannedWay(20.5, 30.25, 1),
)

TIMED = replace(
    STANDING,
    timing=Timing(
        *(1_500_000, 2, -3, 9),
        sectors_us=(4, 0),
        sector_merits=(Merit.BEST, Merit.NONE),
        mini_merits=(Merit.SLOWER, Merit.OWN_BEST, Merit.NONE),
        stints=(Stint(1, 2, 9, 1), Stint(3, 0, 0, 0)),
    ),
)

ORDER = parking.OrderFrame(
    *(2, 1),
    ParkingOrder(
        Slot(1.0, 2.0, 0.5, 3.0, 2.0),
        Level(along=0.5, across=0.25, turn=0.125, still=0.0625, fits=True, hold_s=1.0),
        np.arange(8.0).reshape(2, 4),
        np.ones((1, 5)),
    ),
)
LOT = parking.LotFrame(
    *(2, 600),
    np.array([(1.0, 2.0, 0.5, 3.0, 2.0, -1, 0), (4.0, 2.0, 0.5, 3.0, 2.0, 7, 3)], parking.GOAL),
    np.array([(5.0, 2.0, 0.5, 1.5, 1.0, 2, b"")], parking.BLOCK),
    (parking.WayFrame(3, np.array([(0.0, 1.0), (2.0, 1.5), (4.0, 2.0)])),),
)

STANDINGS = spectate.StandingsFrame(1, 600, 180, Phase.RUNNING, Flag.GREEN, 3, "oval", (STANDING,))

WELCOME = lobby.Welcome(Briefing(1, TT02, 3, "lidar", 0.05, ("boost", "oil"), 3.5), 99, 2, 201)

HUD = drive.HudFrame(
    *(1, 2, 3.5, 1.0, 0.5, 2, 0.25, np.array([(1, 0.5)], drive.EFFECT)),
    *(7, 0.5, 2**40, 1.5, Flag.YELLOW, Trust.DOUBTFUL, PoseFault.JUMP, True),
)

COURSE = lobby.CourseSheet(
    *("oval", "Oval", "0af1", 0.5),
    *(np.ones((3, 4)), np.ones((3, 2)), 0.1, np.ones((2, 4))),
    *(np.arange(2.0), np.ones((1, 3)), np.zeros((0, 2))),
    *(0.5, np.ones((1, 5)), (1, 0), 2.06, 1.3, 0.087),
)
LINE = line.LineSheet(0.1, *(np.arange(3.0) + n for n in range(4)), lap=6.5, note="a stand-in: é")
LINKS = links.LinksFrame(
    2, 600, np.array([(-1, 0, 3, 0, 0, b""), (50, 7, 0, 2, 5, b"")], links.LINK)
)
RAYS = rays.RaysFrame(
    *(600, 7, 1.5, -2.5, 0.25, 0.5, 3.5, 8.0, np.ones(201, "f4")),
    *(0.0, 80.0, np.linspace(-1, 1, 9, dtype="f4"), np.ones(9, "f4"), np.arange(9, dtype="u1")),
)

PROGRAMME = programme.ProgrammeFrame(
    event="cup 2026-11-23",
    title="Time trial",
    phase=EventPhase.ON_TRACK,
    now=programme.Call("Time trial: 7 Anna, attempt 2", ("7 Anna",)),
    limit_s=300.0,
    until_us=2**40,
    driven=3,
    drives=4,
    has_points=True,
    attempts=2,
    coming=(programme.Call("Time trial: Bert, attempt 2", ("Bert",)),),
    teams=(
        programme.TeamRow("Bert", 1, 1, 25, 6_047_000, (6_047_000,), 1, (), "out of time"),
        programme.TeamRow(
            *("7 Anna", 0, 0, 5, 0, (0,), 1),
            (programme.DeletedLap(1, 2, "touched a border"),),
        ),
    ),
    stage="Time trial",
)
_STEPS = np.arange(4, dtype=np.float32)
GHOST = ghosts.GhostFrame(
    "Bert", 1, True, False, 3_000_000, _STEPS, 2.0 * _STEPS, -_STEPS, 5.0 * _STEPS
)


def same(one: object, other: object) -> bool:
    """Return whether two sheets hold the same, arrays included."""
    return all(
        np.array_equal(getattr(one, part.name), getattr(other, part.name)) for part in fields(one)
    )
