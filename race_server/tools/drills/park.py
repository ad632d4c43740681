"""Have many vehicles parked in a running session, and kill its server half way.

All drivers stand with the brake on until the steward says `park`; then the server's parking driver
takes every wheel. All have to be parked in time, no person may be hit, and the recording, driven
again, has to end with the digest of the session. A driver that knows but what it observes has to
answer as it does in training. Some of the vehicles may be real karts, played by plants: they are
sent the order and park themselves, by where they believe to be.
"""

import json
import math
import os
import signal
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from race_server.competition.launch import START_S, spread
from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.driver import YieldingDriver, driver_named
from race_server.core.messages import Control, EventKind, Phase, Standing, Status
from race_server.errors import KeysError, LinkError, LotError, RaceError, SeatError
from race_server.live.client.driver import KartClient
from race_server.live.client.spectator import Spectator
from race_server.live.client.steward import StewardClient
from race_server.live.server.wheels import VALET
from race_server.net.auth.token import read_token
from race_server.net.transport import ClientLink
from race_server.scenario.lot.check import check_lot
from race_server.storage.recording.reader import Recording, read_recording
from race_server.tools.drills.crash import children_of
from race_server.tools.drills.kart import LONGEST_TURN_S
from race_server.tools.drills.park_answers import ROUNDING, compare_answers
from race_server.tools.drills.replay import replay_of
from race_server.tools.drills.report import SmallDrill, document_of
from race_server.tools.drills.server_process import (
    SESSION,
    ServerProcess,
    server_process,
    wait_until,
)

SMALL = SmallDrill("--seats 3 --lot zone-30 --together 1 --real 1", 60, "parked")

# A session of the drill lasts at most this long: by its own clock, and by that of the wall [s].
LIMIT_S, MOST_S = 180, 600.0
# Rounds of the car park that are checked for room before vehicles start.
ROUNDS = 10
# A vehicle that drives for longer than this no longer holds up the others [s].
STUCK_S = 60.0
# A single vehicle has this way behind it [m] when its server is killed.
HALF_M = 10.0
# A server whose session is over ends within this time [s].
END_S = 30.0


class Waiting(KartClient):
    """Stands with the brake on: another driver is to park."""

    preset = "track"

    def act(self, _: object) -> Control:
        """Return a full brake."""
        return Control(brake=1.0)


@dataclass
class Yard:
    """A session under the drill, as its spectator and its steward see it."""

    process: ServerProcess
    spectator: Spectator
    link: ClientLink

    def parked(self) -> int:
        """Return how many vehicles are parked by now."""
        return sum(row.status is Status.FINISHED for row in self.rows())

    def is_half_way(self, seats: int) -> bool:
        """Return whether half of the vehicles are parked, or the only one has driven HALF_M."""
        if seats == 1:
            return any(row.parking and row.parking.way > HALF_M for row in self.rows())
        return 2 * self.parked() >= seats

    def driving(self) -> set[int]:
        """Return the seats whose vehicles are neither parked nor out."""
        return {row.seat for row in self.rows() if row.status is Status.RACING}

    def rows(self) -> tuple[Standing, ...]:
        """Return the newest standings."""
        frame = self.spectator.standings
        return frame.rows if frame else ()

    def order(self, seat: int) -> bool:
        """Have the vehicle of a seat parked; False where the server does not answer now."""
        address = self.process.address
        try:
            steward = StewardClient(self.link, read_token(address, SESSION), "drill")
            steward.decide("park", seat=seat, value=-1.0)
        except (LinkError, KeysError):
            return False  # a server that was killed is still on its way back
        except SeatError:
            return seat not in self.driving()  # out already, or the request was granted before
        return True


def drill_park(
    lot: str = "kart-park",
    *,
    seats: int = 20,
    vehicle: str = "",
    driver: str = VALET,
    together: int = 64,
    seed: int = 1,
    kill: bool = True,
    real: int = 0,
    tell: Callable[[int], None] = lambda _: None,
) -> dict[str, Any]:
    """Return the figures of a session in which all vehicles park on command.

    vehicle: that of the lot where it is empty; driver: that parks; together: number of vehicles
    that are on their way at a time, those nearest to their slots first; kill: end the server once,
    when half of the vehicles are parked or, where one parks, when it has driven half of its way;
    real: how many are real karts; tell: is told how many are parked.

    Raises:
        LotError: the car park has no room for them.
        SeatError: more real karts than seats.
    """
    if not 0 <= real <= seats:
        raise SeatError(f"{real} real karts on {seats} seats: choose at most {seats} for --real")
    begun = time.monotonic()
    for issue in check_lot(lot, vehicle, ROUNDS, seats):
        if issue.level == "error":
            raise LotError(f"{lot} cannot hold {seats}: {issue.what}; or take fewer --seats")
    words = ["--lot", lot, "--karts", str(seats), "--wait-for", str(seats), "--valet", driver]
    words += ["--vehicle", vehicle] if vehicle else []
    words += ["--seed", str(seed), "--one-process", "--limit", str(LIMIT_S)]
    faults: list[str] = []
    with (
        tempfile.TemporaryDirectory(prefix="drill-") as folder,
        server_process([*words, "--record", folder], is_guarded=True) as process,
    ):
        try:
            kills = _run(process, seats, spread(real, seats), together, tell, kill=kill)
            document = process.stop()
        except RaceError as error:
            return document_of([f"{error}; {process.last_words()}"], lot=lot, seats=seats)
        (path,) = Path(folder).glob("*.mcap")
        recording = read_recording(path)
        if fault := replay_of(recording, document["digest"]).fault:
            faults.append(f"the recording {fault}")
        # Training has no karts that move themselves.
        answers = {} if real else _answers_of(recording, driver, faults, most_apart=seats * kills)
        plants = [_report_of(process, seat) for seat in spread(real, seats)]
        answers |= {"plants": _judge_plants(plants, document, faults)} if plants else {}
    if kill and not kills:
        faults.append("the session was over before the server could be killed")
    about = {"lot": lot, "driver": driver, "seats": seats, "kills": kills, "seed": seed}
    return _report(document, faults, **about, **answers, wall_s=round(time.monotonic() - begun, 1))


def _answers_of(
    recording: Recording, driver: str, faults: list[str], *, most_apart: int
) -> dict[str, Any]:
    """Return how far a session is from training, where its driver knows but what it observes.

    most_apart: answers that may differ: after a kill the first one of each driver, which may come
    between two decisions of training.
    """
    if isinstance(driver_named(driver), YieldingDriver):
        return {}  # it also answers to ways that other vehicles announce
    answers = compare_answers(recording, driver)
    if answers.seen > ROUNDING:
        faults.append(f"observations differ from those of training by {answers.seen:.3g}")
    if answers.apart > most_apart:
        faults.append(f"{answers.apart} answers differ from those in training")
    return {"training": asdict(answers)}


def _report_of(process: ServerProcess, seat: int) -> dict[str, Any]:
    """Return what the program of a real kart tells of itself at its end."""
    path = process.place / f"{seat}.json"
    with suppress(RaceError):  # a kart that left no report is told apart
        wait_until(path.exists, END_S, "the report of a real kart")
    told: dict[str, Any] = json.loads(path.read_text()) if path.exists() else {}
    return {"seat": seat, **told}


def _judge_plants(
    plants: list[dict[str, Any]], document: dict[str, Any], faults: list[str]
) -> list[dict[str, Any]]:
    """Return the figures of the real karts. plants: what each tells of itself."""
    rows = []
    for told in plants:
        seat = told["seat"]
        (kart,) = (kart for kart in document["karts"] if kart["seat"] == seat)
        turn_s = told.get("longest_turn_s", math.inf)
        if turn_s > LONGEST_TURN_S:
            faults.append(f"the control loop of the kart on seat {seat} stood for {turn_s:.2f} s")
        rows.append(
            {
                "seat": seat,
                "parked": kart["parking"]["ending"] == "parked",
                "longest_turn_ms": round(1e3 * turn_s) if turn_s < math.inf else None,
                "place_error_p99": told.get("pose_error_p99_m"),
                "scrapes": told.get("scrapes"),
            }
        )
    return rows


def _report(document: dict[str, Any], faults: list[str], **about: Any) -> dict[str, Any]:
    """Return the document of a drill. document: of the session."""
    endings = Counter(kart["parking"]["ending"] for kart in document["karts"])
    hits = sum(event["kind"] == EventKind.HIT_PERSON.name.lower() for event in document["events"])
    parked = endings.pop("parked", 0)
    if endings:
        others = ", ".join(f"{count} {ending}" for ending, count in endings.items())
        faults.append(f"not parked: {others}")
    if hits:
        faults.append(f"{hits} times a person was hit")
    ways = [kart["parking"]["way"] for kart in document["karts"]]
    return document_of(
        faults,
        **about,
        parked=parked,
        people_hit=hits,
        seconds=round(document["ticks"] / TICKS_PER_SECOND, 1),
        way_mean=round(sum(ways) / len(ways), 1),
        vehicles=[{"seat": kart["seat"], **kart["parking"]} for kart in document["karts"]],
    )


def _run(
    process: ServerProcess,
    seats: int,
    real: tuple[int, ...],
    together: int,
    tell: Callable[[int], None],
    *,
    kill: bool,
) -> int:
    """Let all vehicles park; return how many times the server was killed.

    real: seats with real karts.

    Raises:
        RaceError: the session does not begin, or does not end.
    """
    process.wait_for(Phase.LOBBY)
    threads = [
        threading.Thread(target=_wait_in_seat, args=(process.address, seat), daemon=True)
        for seat in set(range(seats)).difference(real)
    ]
    for thread in threads:
        thread.start()
    for seat in real:
        _start_plant(process, seat)
    with ClientLink(process.address, SESSION, timeout_s=START_S) as link:
        yard = Yard(process, Spectator(link), link)
        wait_until(lambda: len(yard.driving()) == seats, START_S, "the start")
        order = _nearest_first(yard)
        ordered: dict[int, float] = {}  # seats, and when [s]
        kills, deadline = 0, time.monotonic() + MOST_S
        while process.server.poll() is None and (yard.driving() or not order):
            if time.monotonic() > deadline:
                raise RaceError(f"the session did not end within {MOST_S:g} s")
            now, driving = time.monotonic(), yard.driving()
            waiting = [seat for seat in order if seat not in ordered]
            lately = [s for s, at in ordered.items() if s in driving and now < at + STUCK_S]
            if waiting and len(lately) < together and yard.order(waiting[0]):
                ordered[waiting[0]] = now
            tell(yard.parked())
            if kill and not kills and yard.is_half_way(seats):
                os.kill(children_of(process.server.pid)[0], signal.SIGKILL)
                kills += 1
            time.sleep(0.05)
    wait_until(lambda: process.server.poll() is not None, END_S, "the end of the server")
    return kills


def _nearest_first(yard: Yard) -> list[int]:
    """Return all seats, those whose vehicles are nearest to their slots first."""

    def is_known() -> bool:
        return yard.spectator.snapshot() is not None and yard.spectator.lot is not None

    wait_until(is_known, START_S, "a round")
    frame, lot = yard.spectator.snapshot(), yard.spectator.lot
    assert frame is not None
    assert lot is not None
    places = {int(kart["seat"]): (kart["x"], kart["y"]) for kart in frame.karts}

    def distance(goal: Any) -> float:
        x, y = places[int(goal["seat"])]
        return math.hypot(goal["x"] - x, goal["y"] - y)

    return [int(goal["seat"]) for goal in sorted(lot.goals, key=distance)]


def _start_plant(process: ServerProcess, seat: int) -> None:
    """Start the program of a real kart that stands until it is ordered to park."""
    words = ["plant", "--driver", VALET, "--on-request", "--connect", process.address]
    words += ["--session", SESSION, "--seat", str(seat), "--seed", str(seat + 1)]
    words += ["--patience", str(START_S), "--report", str(process.place / f"{seat}.json")]
    process.group.start(words, process.log)


def _wait_in_seat(address: str, seat: int) -> None:
    """Hold a seat until the session is over."""
    with suppress(RaceError):
        Waiting().run(address, session=SESSION, name=f"waiting {seat}", seat=seat)
