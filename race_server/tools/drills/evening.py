"""A whole evening on the network, its server killed in each phase, stopped and started again.

Six drivers, one of them a learned one and one a real kart played by a plant, go through a time
trial with two attempts, a qualification with obstacles, two heats and a final. The server is killed
in the middle of each, and once between two attempts. In the second heat it is stopped and all
programs end, as in the evening; then all are started again, as the next morning. At the end the
event's file, the results file and the result document must hold the same laps, each attempt and
race once. Some of the drivers may be people at the page (`page_drivers`), in real browsers.
"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from race_server.competition.event_state import SUFFIX, EventState, read_event
from race_server.competition.launch import (
    START_S,
    ProcessGroup,
    free_address,
    process_group,
)
from race_server.errors import RaceError
from race_server.logs import last_words
from race_server.storage.results.queries import races
from race_server.tools.drills.chromium import PAGE_ERROR, missing_page
from race_server.tools.drills.crash import children_of
from race_server.tools.drills.gateway_process import start_gateway
from race_server.tools.drills.report import document_of

TRACK, SESSION = "oval", "evening"
# People take the seats of the last ones.
PROGRAMS = ("learned:time-trial", "raceline", "follow_gap", "pure_pursuit", "avoider")
PEOPLE = ("Ada", "Ben")
REAL = "pure_pursuit"  # drives the real kart
FORMAT = """
title = "Evening"

[[stage]]
kind = "time trial"
name = "Time trial"
counts = "lap"
laps = 1
failure_s = 60.0

[[stage]]
kind = "time trial"
name = "Qualification"
laps = 1
attempts = 1
obstacles = {}
failure_s = 60.0

[[stage]]
kind = "races"
name = "Heat"
laps = 1
most = 3
mixed = true
points = [5, 3, 1]

[[stage]]
kind = "races"
name = "Final"
laps = 1
most = 6
points = [10, 6, 4, 3, 2, 1]
"""
# Attempts and races of the evening by stage.
DRIVES = {"Time trial": 12, "Qualification": 6, "Heat": 2, "Final": 1}
# In which drives, counted from 0, the server is killed while karts drive …
KILLED_IN = {3: "Time trial", 14: "Qualification", 18: "Heat", 20: "Final"}
# … or between two of them, and in which it is stopped.
KILLED_BEFORE, STOPPED_IN = 8, 19
# After the start of an attempt or a race [s].
KILL_S = 4.5
LONGEST_S = 900.0
RESUME_S = 5.0

PAGES = "race_server.tools.drills.page_drivers"

Line = dict[str, Any]


@dataclass
class Evening:
    """The programs of an evening, and what the server's log says."""

    place: Path
    group: ProcessGroup
    log: Any
    people: tuple[str, ...] = ()
    address: str = field(default_factory=free_address)
    kills: list[str] = field(default_factory=list)
    resume_s: list[float] = field(default_factory=list)
    faults: list[str] = field(default_factory=list)  # of the pages
    pages: subprocess.Popen[bytes] | None = None  # drives them
    _read: int = 0

    def start(self) -> None:
        """Start the server and all drivers."""
        self.group.processes.clear()
        self.group.start(self._serve(), self.log)
        waits = ["--patience", str(START_S)]
        for name in PROGRAMS[: len(PROGRAMS) - len(self.people)]:
            self.group.start(["drive", name, *self._ask(), *waits], self.log, aside=True)
        self.group.start(["plant", "--driver", REAL, *self._ask(), *waits], self.log, aside=True)
        if self.people:
            self._start_pages()

    def _start_pages(self) -> None:
        """Start a gateway, and a process with the browsers of the people and of one who watches."""
        words = [*self._ask(), "--drivers", str(len(self.people))]
        _, addresses = start_gateway(self.group, self.log, *words)
        pairs = zip(self.people, addresses["drive"], strict=True)
        command = [sys.executable, "-m", PAGES, addresses["base"], str(self.place)]
        command += [word for pair in pairs for word in pair]
        self.pages = subprocess.Popen(command, stdout=self.log, stderr=self.log)
        self.group.aside.append(self.pages)

    def _serve(self) -> list[str]:
        place = self.place
        words = ["serve", "--format", str(place / "evening.toml"), "--track", TRACK, "--once"]
        words += ["--karts", str(len(PROGRAMS) + 1), "--listen", self.address]
        words += ["--session", SESSION, "--record", str(place), "--call-limit", "30"]
        words += ["--results", str(place / "results.sqlite")]
        return [*words, "--result", str(place / "result.json"), "--json"]

    def _ask(self) -> list[str]:
        return ["--connect", self.address, "--session", SESSION]

    def lines(self) -> list[Line]:
        """Return what the log says since the last call; errors of the pages are faults."""
        with (self.place / "log").open("rb") as file:
            file.seek(self._read)
            data = file.read()
        whole = data[: data.rfind(b"\n") + 1]
        self._read += len(whole)
        said = []
        for line in whole.splitlines():
            try:
                words = json.loads(line)
            except ValueError:
                continue
            if isinstance(words, dict) and "event" in words and "timestamp" in words:
                said.append(words)
                if words["event"] == PAGE_ERROR:
                    self.faults.append(f"an error of the page: {words['why']}")
        return said

    @property
    def is_over(self) -> bool:
        """Whether the server has ended."""
        return self.group.processes[0].poll() is not None

    def check_pages(self) -> None:
        """Check that the browsers are still driven.

        Raises:
            RaceError: their program has ended.
        """
        if self.pages is not None and self.pages.poll() is not None:
            raise RaceError("the program that drives the browsers ended")

    def kill(self, where: str) -> None:
        """Kill the server; its supervisor starts another one."""
        (child, *_) = children_of(self.group.processes[0].pid)
        os.kill(child, signal.SIGKILL)
        self.kills.append(where)
        begun, deadline = time.monotonic(), time.monotonic() + START_S
        while not any(line["event"] in _GOING_ON for line in self.lines()):
            if time.monotonic() > deadline or self.is_over:
                raise RaceError(f"the event did not go on after a kill: {where}")
            time.sleep(0.01)
        self.resume_s.append(time.monotonic() - begun)

    def stop(self) -> None:
        """Stop the server, and end all programs."""
        self.group.processes[0].send_signal(signal.SIGTERM)
        self.group.processes[0].wait(START_S)
        self.group.end()
        self.group.aside.clear()


_GOING_ON = {"going on with an event"}


def drill_evening(
    browsers: int = 0,
    keep: Path | None = None,
    tell: Callable[[int], None] = lambda _: None,
) -> dict[str, Any]:
    """Run an evening and return its figures.

    browsers: people at the page; keep: folder for all that is written, with pictures of the page,
    None for none; tell: called with the number of drives so far.

    Raises:
        RaceError: a page cannot be driven here, or an event is in the folder already.
    """
    if browsers and (reason := missing_page()):
        raise RaceError(f"no browser can drive: {reason}")
    if keep is not None and any(keep.glob(f"{SESSION}*{SUFFIX}")):
        raise RaceError(f"an evening is in {keep} already: name another folder")
    with tempfile.TemporaryDirectory(prefix="evening-") as folder, process_group() as group:
        place = keep or Path(folder)
        place.mkdir(parents=True, exist_ok=True)
        (place / "evening.toml").write_text(FORMAT)
        with (place / "log").open("wb") as log:
            evening = Evening(place, group, log, PEOPLE[:browsers])
            try:
                evening.start()
                _follow(evening, tell)
                return _report(evening)
            except RaceError as error:
                words = last_words(place / "log", 3)
                return document_of([f"{error}; {words}"], kills=len(evening.kills))


def _follow(evening: Evening, tell: Callable[[int], None]) -> None:
    """Kill and stop the server where that is due, until the event is over."""
    driven, due_at = 0, 0.0
    todo = {*KILLED_IN, STOPPED_IN}
    between, deadline = True, time.monotonic() + LONGEST_S
    while not evening.is_over:
        if time.monotonic() > deadline:
            raise RaceError(f"the evening was not over after {LONGEST_S:g} s")
        evening.check_pages()
        for line in evening.lines():
            if line["event"] in {"driven", "found"}:
                driven, due_at = driven + (line["event"] == "driven"), 0.0
                tell(driven)
            elif line["event"] == "race started" and driven in todo:
                due_at = time.monotonic() + KILL_S
            elif line["event"] == "called" and driven == KILLED_BEFORE and between:
                between = False
                evening.kill("between two attempts")
        if 0.0 < due_at < time.monotonic():
            due_at = 0.0
            todo.discard(driven)
            if driven == STOPPED_IN:
                evening.stop()
                evening.start()
            else:
                evening.kill(KILLED_IN[driven])
        time.sleep(0.02)


def _report(evening: Evening) -> dict[str, Any]:
    place, faults = evening.place, evening.faults
    found = sorted(place.glob(f"{SESSION}-*{SUFFIX}"))
    if len(found) != 1:
        raise RaceError(f"{len(found)} events are over, 1 was expected")
    state = read_event(found[0])
    kept = races(place / "results.sqlite", limit=-1)
    faults += _differences(state, kept)
    document = json.loads((place / "result.json").read_text())
    if not document["is_final"] or document["driven"] != len(state.records):
        faults.append("the result document is not that of the whole event")
    teams = {one.team for one in state.entrants}
    if {row["team"] for row in document["classification"]} != teams:
        faults.append("not all drivers are in the classification")
    if len(evening.kills) != len(KILLED_IN) + 1:
        faults.append(f"the server was killed {len(evening.kills)} times only")
    if max(evening.resume_s, default=0.0) > RESUME_S:
        faults.append(f"it took more than {RESUME_S:g} s to go on")
    absent = sum(
        drive.remark.startswith("did not start")
        for record in state.records
        for drive in record.drives
    )
    laps = Counter[str]()
    for record in state.records:
        laps.update({drive.team: drive.laps for drive in record.drives})
    if idle := [team for team in teams if not laps[team]]:
        faults.append(f"no lap of {', '.join(idle)}")
    if absent:
        faults.append(f"{absent} times a driver was not there for its call")
    return document_of(
        faults,
        drivers=len(teams),
        drives=len(state.records),
        kills=len(evening.kills),
        stopped=Counter(row["ended"] for row in kept)["stopped"],
        absent=absent,
        laps=laps.total(),
        **(
            {"laps_of_people": sum(laps[name] for name in evening.people)} if evening.people else {}
        ),
        podium=", ".join(document["podium"]),
        resume_s_worst=round(max(evening.resume_s, default=0.0), 2),
    )


def _differences(state: EventState, kept: list[dict[str, Any]]) -> list[str]:
    """Return how the event's file and the results file differ."""
    faults = []
    if len(state.records) != sum(DRIVES.values()) or not state.is_final:
        faults.append(f"{len(state.records)} attempts and races were driven, 21 were expected")
    finished = {row["digest"]: row for row in kept if row["ended"] == "finished"}
    titles = Counter(row["title"] for row in finished.values())
    if again := [title for title, times in titles.items() if times > 1]:
        faults.append(f"driven twice: {', '.join(again)}")
    teams = {one.team: one.seat for one in state.entrants}
    for record in state.records:
        if not record.digest:
            continue
        row = finished.get(record.digest)
        if row is None:
            faults.append(f"a race of {', '.join(record.grid)} is not in the results file")
            continue
        times = {entry["seat"]: entry["race_time_us"] for entry in row["entries"]}
        mine = {teams[drive.team]: drive.time_us for drive in record.drives if drive.lap_times_us}
        if any(times.get(seat) != time_us for seat, time_us in mine.items()):
            faults.append(f"{row['title']}: the results file has other times")
    return faults
