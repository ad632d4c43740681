"""Kill the server in the middle of races, several times; no lap may be lost.

A third of the kills fall at any moment, a third inside a commit to the results file and a third
inside the write of a chunk of the recording.

Each race is a real server with its guard and eight driver processes; some of the karts may be real
ones, played by plants, which the server has to trust again each time. A spectator records what is
announced, and the drill compares every announced lap with the result, the recording and the
results file at the end.
"""

import json
import random
import statistics
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from race_server.competition.launch import (
    START_S,
    ProcessGroup,
    free_address,
    process_group,
    spread,
)
from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.messages import EventKind, Phase
from race_server.errors import LinkError, RaceError, WireError
from race_server.logs import last_words
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.spectate import decode_events, decode_snapshot
from race_server.storage.recording.reader import read_recording
from race_server.storage.results.queries import all_laps
from race_server.tools.drills.kill_points import KillPoint, draw_point, kill_at
from race_server.tools.drills.replay import replay_of
from race_server.tools.drills.report import SmallDrill, document_of
from race_server.tools.drills.torn import is_torn

SMALL = SmallDrill("--times 3 --laps 2", 40, "resume_s_worst")

TRACK, KARTS = "oval-report", 8
DRIVERS = ("pure_pursuit", "follow_gap", "avoider")
# Time from the start or the resumption of a race to the next kill [s].
SOONEST_S, LATEST_S = 0.3, 2.0
# Limit for a race to resume [s], and what each second raced may add: it is driven again.
RESUME_S, RERUN_S = 1.0, 0.005
PATIENCE_S = 30.0

Lap = tuple[int, int, int]  # seat, number, time [µs]


@dataclass
class CrashSpectator:
    """Records what a spectator receives of a race over the network."""

    most_laps: int  # to the finish
    laps: set[Lap] = field(default_factory=set)
    tick: int = -1
    heard_at: float = 0.0
    phase: Phase = Phase.LOBBY

    def hear_events(self, data: bytes) -> None:
        """Record announced laps."""
        for event in decode_events(data)[1]:
            if event.kind is EventKind.LAP:
                self.laps.add((event.kart, event.other, event.value))

    def hear_snapshot(self, data: bytes) -> None:
        """Record the tick, the phase and the time."""
        try:
            frame = decode_snapshot(data)
        except WireError:
            return
        self.tick, self.phase, self.heard_at = frame.tick, frame.phase, time.monotonic()

    def is_nearly_over(self) -> bool:
        """Return whether at most one kart is still racing: its finish would end the server."""
        finished = sum(number == self.most_laps for _, number, _ in self.laps)
        return self.phase is Phase.FINISHED or finished >= KARTS - 1

    def hears_since(self, moment: float) -> bool:
        """Return whether a snapshot arrived after a time of `time.monotonic`."""
        return self.heard_at > moment


@dataclass
class RaceReport:
    """Report on one race."""

    kills: int = 0
    points: Counter[KillPoint] = field(default_factory=Counter)  # that kills fell into
    torn: int = 0  # kills that left half a commit or half a chunk
    resume_s: list[float] = field(default_factory=list)
    slow: int = 0  # resumptions beyond their limit
    lost_ticks: list[int] = field(default_factory=list)
    real_laps: int = 0
    faults: list[str] = field(default_factory=list)


def drill_crash(
    times: int,
    *,
    laps: int = 6,
    real: int = 0,
    seed: int = 1,
    tell: Callable[[int], None] = lambda _: None,
) -> dict[str, Any]:
    """Kill a racing server `times` times and return the figures.

    laps: to the finish of a race; real: number of real karts; tell: called with the number of
    kills so far.
    """
    chance = random.Random(seed)
    reports: list[RaceReport] = []
    while (done := sum(report.kills for report in reports)) < times:
        tell(done)
        report = _race(times - done, laps, real, chance, partial(_tell_sum, tell, done))
        reports.append(report)
        if report.kills == 0 and not report.faults:
            report.faults.append("a race ended before the server could be killed")
        if report.faults:
            break
    resumes = [value for report in reports for value in report.resume_s]
    faults = [fault for report in reports for fault in report.faults]
    if slow := sum(report.slow for report in reports):
        faults.append(
            f"{slow} of {len(resumes)} times it took more than {RESUME_S:g} s "
            f"and {1000.0 * RERUN_S:g} ms for each second raced"
        )
    return document_of(
        faults,
        kills=sum(report.kills for report in reports),
        kills_in_commits=sum(report.points[KillPoint.COMMIT] for report in reports),
        kills_in_chunks=sum(report.points[KillPoint.CHUNK] for report in reports),
        torn=sum(report.torn for report in reports),
        races=len(reports),
        karts=KARTS,
        real_karts=real,
        real_laps=sum(report.real_laps for report in reports),
        resumed=len(resumes),
        laps_lost=sum("lap" in fault for fault in faults),
        resume_s_median=round(statistics.median(resumes), 3) if resumes else None,
        resume_s_worst=round(max(resumes), 3) if resumes else None,
        ticks_lost_worst=max((n for r in reports for n in r.lost_ticks), default=0),
        seed=seed,
    )


def _tell_sum(tell: Callable[[int], None], before: int, kills: int) -> None:
    tell(before + kills)


def _race(
    most: int, laps: int, real: int, chance: random.Random, tell: Callable[[int], None]
) -> RaceReport:
    """Run one race, killing its server at most `most` times, and check what it wrote."""
    report = RaceReport()
    with tempfile.TemporaryDirectory(prefix="drill-") as folder, process_group() as group:
        place = Path(folder)
        address = free_address()
        with (place / "log").open("wb") as log:
            _start(group, address, laps, real, place, log)
            try:
                spectator, link = _watch(address, laps)
                with link:
                    guard = group.processes[0].pid
                    _kill_and_wait(guard, place, spectator, report, most, chance, tell)
                    _wait(lambda: group.processes[0].poll() is not None, START_S, "end")
                _check(place, spectator, spread(real, KARTS), report)
            except RaceError as error:
                report.faults.append(f"{error}; {last_words(place / 'log', 3)}")
    return report


def _start(group: ProcessGroup, address: str, laps: int, real: int, place: Path, log: Any) -> None:
    serve = ["serve", "--track", TRACK, "--karts", str(KARTS), "--laps", str(laps), "--once"]
    serve += ["--listen", address, "--session", "drill", "--record", str(place)]
    serve += ["--results", str(place / "results.sqlite"), "--result", str(place / "result.json")]
    group.start(serve, log)
    for seat in range(KARTS):
        name = DRIVERS[seat % len(DRIVERS)]
        ask = ["--connect", address, "--session", "drill", "--seat", str(seat)]
        ask += ["--patience", str(START_S)]
        plant = ["plant", "--driver", name, "--seed", str(seat + 1)]
        group.start([*(plant if seat in spread(real, KARTS) else ["drive", name]), *ask], log)


def _watch(address: str, laps: int) -> tuple[CrashSpectator, ClientLink]:
    deadline = time.monotonic() + START_S
    while True:
        try:
            link = ClientLink(address, "drill", timeout_s=1.0)
        except LinkError:
            if time.monotonic() > deadline:
                raise
            continue
        spectator = CrashSpectator(laps)
        link.listen(topics.EVENTS, spectator.hear_events)
        link.listen(topics.SNAPSHOT, spectator.hear_snapshot)
        return spectator, link


def _kill_and_wait(
    guard: int,
    place: Path,
    spectator: CrashSpectator,
    report: RaceReport,
    most: int,
    chance: random.Random,
    tell: Callable[[int], None],
) -> None:
    """Kill the server at random points, each time after the race resumed."""
    files = {
        KillPoint.COMMIT: place / "results.sqlite-wal",
        KillPoint.CHUNK: place / "drill.journal.mcap",
    }
    _wait(lambda: spectator.phase in {Phase.COUNTDOWN, Phase.RUNNING}, START_S, "start")
    while report.kills < most:
        pause = threading.Event()
        pause.wait(chance.uniform(SOONEST_S, LATEST_S))
        if spectator.is_nearly_over() or not (children := children_of(guard)):
            return
        point, delay_s = draw_point(chance)
        is_writing = kill_at(point, children[0], files, delay_s)
        tick, killed_at = spectator.tick, time.monotonic()
        report.points[point] += is_writing
        report.torn += is_writing and is_torn(files[point])
        report.kills += 1
        # A message that was on its way when the server died does not count.
        _wait(partial(spectator.hears_since, killed_at + 0.05), PATIENCE_S, "resume")
        took_s = spectator.heard_at - killed_at
        report.resume_s.append(took_s)
        report.slow += took_s > RESUME_S + RERUN_S * tick / TICKS_PER_SECOND
        report.lost_ticks.append(max(tick - spectator.tick, 0))
        tell(report.kills)


def children_of(parent: int) -> list[int]:
    """Return the child processes of a process (Linux: /proc)."""
    path = Path(f"/proc/{parent}/task/{parent}/children")
    return [int(word) for word in path.read_text().split()] if path.exists() else []


def _wait(is_so: Callable[[], bool], timeout_s: float, what: str) -> None:
    deadline = time.monotonic() + timeout_s
    while not is_so():
        if time.monotonic() > deadline:
            raise RaceError(f"the race did not {what} within {timeout_s:g} s")
        time.sleep(0.002)


def _check(
    place: Path, spectator: CrashSpectator, real: tuple[int, ...], report: RaceReport
) -> None:
    """Compare the announced laps with result, recording and results file."""
    result = place / "result.json"
    if not result.exists():
        report.faults.append("the race ended without a result")
        return
    document = json.loads(result.read_text())
    driven = {
        (kart["seat"], number, time_us)
        for kart in document["karts"]
        for number, time_us in enumerate(kart["lap_times_us"], 1)
    }
    real_laps = {seat: sum(lap[0] == seat for lap in driven) for seat in real}
    report.real_laps = sum(real_laps.values())
    if standing := [str(seat) for seat, laps in real_laps.items() if laps == 0]:
        report.faults.append(f"real karts finished no lap: seats {', '.join(standing)}")
    kept = {(r["seat"], r["lap"], r["time_us"]) for r in all_laps(place / "results.sqlite")}
    (path,) = place.glob("drill-*.mcap")
    recording = read_recording(path)
    recorded = {(seat, number, time_us) for seat, number, time_us, _ in recording.laps}
    for name, laps in (("result", driven), ("results file", kept), ("recording", recorded)):
        if missing := spectator.laps - laps:
            report.faults.append(f"{len(missing)} announced laps are not in the {name}")
    if fault := replay_of(recording, document["digest"]).fault:
        report.faults.append(f"its recording {fault}")
