"""Drivers with names made to break outputs, and a disk that takes nothing: the server serves on.

Three races of one server, which has no guard. In the first the names are markup of a terminal, a
formula of a spreadsheet, and as long as a name may be. In the second not a byte can be written to
a file. In the third it can be again.
"""

import json
import random
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from race_server.competition.launch import START_S, free_address
from race_server.core.driver import driver_named
from race_server.errors import RaceError, RecordingError, ResultsError
from race_server.live.client.driver import run_driver
from race_server.net.wire.strict import MOST_NAME
from race_server.storage.recording.reader import read_recording
from race_server.storage.results.queries import all_laps, best_laps, finished_races, races
from race_server.tools.drills.report import Finding, SmallDrill, matrix_of, skipped
from race_server.tools.drills.server_process import wait_until

SMALL = SmallDrill("", 35, "acts")
TRACK, SESSION, DRIVER = "oval", "drill", "pure_pursuit"
MARKUP, FORMULA, LONG = "[/x]", "=1+1", "名" * MOST_NAME
NAMES = (MARKUP, FORMULA, LONG)
# Damaged copies of the results file that are read.
DAMAGES = 150
# What the server must have said of a disk that takes nothing.
WARNINGS = ("recording ", "results file ", "the result is not in ")


@dataclass
class _Output:
    """A server whose files are all in one folder, what it says, and what was found."""

    folder: Path
    address: str
    server: subprocess.Popen[str]
    said: list[str] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)

    @property
    def result(self) -> Path:
        return self.folder / "result.json"

    @property
    def results(self) -> Path:
        return self.folder / "results.sqlite"

    def find(self, act: str, expected: str, fault: str) -> None:
        """Add a finding. fault: "" if what was expected came."""
        self.findings.append(Finding(act, expected, fault or expected, not fault))

    def race(self, act: str, names: tuple[str, ...]) -> None:
        """Drive a race to its end with drivers of these names, and see that the server is there."""
        faults: list[str] = []
        ended = self._count("race ended")
        drivers = [threading.Thread(target=self._drive, args=(name, faults)) for name in names]
        for driver in drivers:
            driver.start()
        for driver in drivers:
            driver.join()
        wait_until(partial(self._is_over, ended), START_S, "the end of the race")
        time.sleep(1.0)  # in which the result is told
        if self.server.poll() is not None:
            faults.append(f"the server has ended: {''.join(self.said[-3:])}")
        self.find(act, "the server serves on", "; ".join(faults))

    def _is_over(self, before: int) -> bool:
        return self._count("race ended") > before or self.server.poll() is not None

    def _count(self, words: str) -> int:
        return sum(words in line for line in self.said)

    def _drive(self, name: str, faults: list[str]) -> None:
        try:
            run_driver(
                driver_named(DRIVER), name, address=self.address, session=SESSION, timeout_s=START_S
            )
        except RaceError as error:
            faults.append(f"{name}: {error}")

    def hear(self) -> None:
        """Take what the server says until it ends."""
        assert self.server.stdout is not None
        for line in self.server.stdout:
            self.said.append(line)


def drill_output(tell: Callable[[int], None] = lambda _: None) -> dict[str, Any]:
    """Return the document of `race drill output`. tell: called with the races so far."""
    if not hasattr(resource, "prlimit"):
        return skipped("only Linux takes a running process the right to write")
    begun = time.perf_counter()
    with tempfile.TemporaryDirectory(prefix="drill-") as folder, _serving(Path(folder)) as output:
        try:
            output.race("race of drivers with such names", NAMES)
            tell(1)
            _read_results(output)
            _race_without_disk(output)
            tell(2)
            _race_again(output)
            tell(3)
            _stop(output)
            _damage_results(output)
        except RaceError as error:
            output.find("all acts", "done", str(error))
        findings = output.findings
    return matrix_of(findings, acts=len(findings), seconds=round(time.perf_counter() - begun, 1))


@contextmanager
def _serving(folder: Path) -> Iterator[_Output]:
    address = free_address()
    words = ["serve", "--no-guard", "--track", TRACK, "--laps", "1", "--karts", str(len(NAMES))]
    words += ["--listen", address, "--session", SESSION, "--record", str(folder)]
    words += ["--results", str(folder / "results.sqlite"), "--result", str(folder / "result.json")]
    with subprocess.Popen(
        [sys.executable, "-m", "race_server", *words],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    ) as server:
        output = _Output(folder, address, server)
        hearing = threading.Thread(target=output.hear, daemon=True)
        hearing.start()
        try:
            yield output
        finally:
            server.kill()
            hearing.join()


def _read_results(output: _Output) -> None:
    """Read the results with every command that lists them, and what the server has said."""
    table = output.folder / "laps.csv"
    for words in (["list"], ["best"], ["ratings"], ["export", str(table)]):
        command = [sys.executable, "-m", "race_server", "results", *words]
        done = subprocess.run(
            [*command, "--results", str(output.results)],
            capture_output=True,
            text=True,
            check=False,
        )
        fault = "" if done.returncode == 0 else done.stderr[-200:]
        output.find(f"race results {words[0]}", "lists them", fault)
    laps = table.read_text() if table.exists() else ""
    missing = [name for name in (MARKUP, f"'{FORMULA}", LONG) if name not in laps]
    output.find("names in a .csv file", "no formula", f"missing: {missing}" if missing else "")
    said = "".join(output.said)
    odd = sorted({letter for letter in said if not letter.isprintable()} - {"\n"})
    fault = f"it has {odd}" if odd else "" if MARKUP in said else f"{MARKUP} is missing"
    output.find("names in log and table of the server", "as they are", fault)


def _race_without_disk(output: _Output) -> None:
    """Race while the server can write to no file."""
    before = output.result.read_text()
    _, most = resource.prlimit(output.server.pid, resource.RLIMIT_FSIZE)
    resource.prlimit(output.server.pid, resource.RLIMIT_FSIZE, (0, most))
    output.race("race while the disk takes nothing", NAMES)
    resource.prlimit(output.server.pid, resource.RLIMIT_FSIZE, (most, most))
    after = output.result.read_text()
    output.find("the result of the race before", "as it was", "" if after == before else "changed")
    said = "".join(output.said)
    for words in WARNINGS:
        output.find(f"'{words}...' in the log", "logged", "" if words in said else "not logged")


def _race_again(output: _Output) -> None:
    """Race with room on the disk again; all is written."""
    output.race("race with room again", NAMES)
    document = json.loads(output.result.read_text())
    finished = races(output.results)
    newest = finished[0] if finished else {}
    fault = "" if newest.get("digest") == document["digest"] else "another race"
    output.find("the result document", "of this race", fault)
    wanted = 3
    fault = "" if len(finished) == wanted else f"{len(finished)} of {wanted} races"
    output.find("the results file", "all three races", fault)
    complete = sum(_is_complete(path) for path in output.folder.glob(f"{SESSION}-*.mcap"))
    fault = "" if complete == wanted - 1 else f"{complete} complete recordings"
    output.find("the recordings", "of the first and the third race", fault)


def _is_complete(path: Path) -> bool:
    try:
        return read_recording(path).is_complete
    except RecordingError:
        return False


def _stop(output: _Output) -> None:
    output.server.send_signal(signal.SIGTERM)
    try:
        status = output.server.wait(15.0)
    except subprocess.TimeoutExpired as error:
        raise RaceError("the server does not end on SIGTERM") from error
    output.find("SIGTERM", "exit status 0", "" if status == 0 else f"exit status {status}")


def _damage_results(output: _Output, seed: int = 1) -> None:
    """Read damaged copies of the results file: what cannot be read is one kind of error."""
    whole, chance = output.results.read_bytes(), random.Random(seed)
    outcomes: Counter[str] = Counter()
    for number in range(DAMAGES):
        data = bytearray(whole)
        for _ in range(chance.choice((1, 8, 64, 300))):
            data[chance.randrange(len(data))] = chance.randrange(256)
        copy = output.folder / f"damaged-{number}.sqlite"
        copy.write_bytes(data[: chance.randrange(len(data))] if chance.random() < 0.2 else data)
        for ask in (races, best_laps, all_laps, finished_races):
            try:
                ask(copy)
                outcomes["read"] += 1
            except ResultsError:
                outcomes["refused"] += 1
            except Exception as error:
                outcomes[type(error).__name__] += 1
    foreign = set(outcomes) - {"read", "refused"}
    fault = f"raises {', '.join(sorted(foreign))}" if foreign else ""
    output.find(f"{DAMAGES} damaged results files", "read, or refused in a sentence", fault)
