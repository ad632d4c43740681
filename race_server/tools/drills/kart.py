"""A real kart whose link stalls and comes back, and whose race is paused for longer than it waits.

Its control loop must turn all the while, because its reflex lives there, and after both the kart
must be in the race.
"""

import json
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from race_server.core.messages import KartFlag, Phase, Status
from race_server.errors import RaceError, WireError
from race_server.live.client.steward import StewardClient
from race_server.net.auth.token import read_token
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.spectate import decode_snapshot
from race_server.tools.drills.report import SmallDrill, document_of
from race_server.tools.drills.server_process import (
    SESSION,
    ServerProcess,
    server_process,
    wait_until,
)
from race_server.tools.drills.stalled_link import StalledLink

SMALL = SmallDrill("--pause 11", 36, "longest_turn_ms")

TRACK = "oval-report"
DRIVE_S = 4.0  # of racing before each incident, and after the last
# A link that has stalled is closed by zenoh after its lease, and opened again.
BACK_S = 20.0
# Longest turn of the control loop: 50 a second, and what a busy machine adds.
LONGEST_TURN_S = 0.3
# Limit of a speed above the cap, once there was time to brake [m/s].
EXCESS = 0.1
_LOST = KartFlag.DOUBTFUL | KartFlag.SUSPENDED


@dataclass
class RealKartView:
    """What a spectator sees of the real kart on seat 0."""

    flags: int = 0
    status: int = Status.RACING
    progress: float = 0.0
    heard_at: float = field(default_factory=time.monotonic)

    def receive(self, data: bytes) -> None:
        """Record a snapshot."""
        try:
            (kart,) = (row for row in decode_snapshot(data).karts if row["seat"] == 0)
        except (WireError, ValueError):
            return
        self.flags, self.status = int(kart["flags"]), int(kart["status"])
        self.progress, self.heard_at = float(kart["progress"]), time.monotonic()

    @property
    def is_trusted(self) -> bool:
        """Whether the kart races and is where it says."""
        is_racing = self.status == Status.RACING and bool(self.flags & KartFlag.REAL)
        return is_racing and not self.flags & _LOST


def drill_kart(pause_s: float, *, tell: Callable[[int], None] = lambda _: None) -> dict[str, Any]:
    """Race a real kart over a link that stalls, then pause the race; return the figures.

    pause_s: for how long the race is paused [s]; tell: called with the seconds passed so far.
    """
    begun = time.monotonic()
    words = ["--track", TRACK, "--karts", "2", "--laps", "1000", "--record", "none"]
    words += ["--items", "off"]
    tell(0)
    with server_process(words) as place, StalledLink(place.address) as stalled:
        report = place.place / "kart.json"
        plant = _start(place, stalled, report)
        place.wait_for(Phase.RUNNING)
        figures, faults = _provoke(place, stalled, pause_s, lambda: tell(_since(begun)))
        place.stop()
        wait_until(lambda: plant.poll() is not None, BACK_S, "the end of the kart's program")
        kart: dict[str, Any] = json.loads(report.read_text()) if report.exists() else {}
    return document_of(
        [*faults, *_judge(kart)],
        **figures,
        pause_s=pause_s,
        longest_turn_ms=round(1e3 * kart.get("longest_turn_s", 0.0)),
        most_over_cap=round(kart.get("worst_excess", 0.0), 3),
        seconds=_since(begun),
    )


def _since(begun: float) -> int:
    return round(time.monotonic() - begun)


def _start(place: ServerProcess, stalled: StalledLink, report: Path) -> Any:
    """Start a real kart on seat 0 behind the link, and another kart on seat 1."""
    ask = ["--connect", stalled.address, "--session", SESSION, "--seat", "0"]
    plant = place.group.start(
        ["plant", *ask, "--patience", "120", "--report", str(report)], place.log
    )
    place.drive("pure_pursuit", 1)
    return plant


def _provoke(
    place: ServerProcess, stalled: StalledLink, pause_s: float, tell: Callable[[], None]
) -> tuple[dict[str, Any], list[str]]:
    """Let the link stall, then pause the race; return figures and faults."""
    figures: dict[str, Any] = {"back_after_s": None, "drives_after_pause": None}
    token = read_token(place.address, SESSION)
    with ClientLink(place.address, SESSION) as link:
        view, steward = RealKartView(), StewardClient(link, token, "drill")
        link.listen(topics.SNAPSHOT, view.receive)
        wait_for = partial(_wait, tell, view)
        try:
            wait_for(lambda: view.is_trusted, BACK_S, "the kart being trusted at first")
            _pass(DRIVE_S, tell)
            frozen_at = time.monotonic()
            stalled.freeze()
            wait_for(lambda: bool(view.flags & _LOST), BACK_S, "the kart being missed")
            wait_for(lambda: view.is_trusted, BACK_S, "the kart being back after the stall")
            figures["back_after_s"] = round(time.monotonic() - frozen_at, 1)
            _pass(DRIVE_S, tell)
            steward.decide("pause")
            _pass(pause_s, tell)
            before = view.progress
            steward.decide("resume")
            _pass(DRIVE_S, tell)
            wait_for(lambda: view.is_trusted, BACK_S, "the kart being trusted after the pause")
            figures["drives_after_pause"] = view.progress != before
        except RaceError as error:
            return figures, [str(error)]
    stands = "the kart does not drive on after the pause"
    return figures, [] if figures["drives_after_pause"] else [stands]


def _wait(
    tell: Callable[[], None],
    view: RealKartView,
    is_so: Callable[[], bool],
    timeout_s: float,
    what: str,
) -> None:
    def is_so_now() -> bool:
        tell()
        if view.status != Status.RACING:
            raise RaceError(f"the kart is out of the race; {what} was waited for")
        return is_so()

    wait_until(is_so_now, timeout_s, what)


def _pass(seconds: float, tell: Callable[[], None]) -> None:
    deadline = time.monotonic() + seconds
    while (left := deadline - time.monotonic()) > 0.0:
        tell()
        time.sleep(min(left, 0.5))


def _judge(kart: dict[str, Any]) -> list[str]:
    """Return what is wrong in the report of the kart's program."""
    if not kart:
        return ["the kart left no report"]
    faults = []
    if kart["longest_turn_s"] > LONGEST_TURN_S:
        faults.append(
            f"its control loop stood for {kart['longest_turn_s']:.2f} s; {LONGEST_TURN_S:g} s are "
            "allowed"
        )
    if kart["worst_excess"] > EXCESS:
        faults.append(f"it went {kart['worst_excess']:.2f} m/s over its speed cap")
    return faults
