"""Drivers that a server keeps apart from itself: each runs as a process, `race drive`.

A driver that hangs, crashes or takes the interpreter lock stops only itself there: its kart brakes,
and is out after 10 s, as that of any driver whose link falls silent. It is no sandbox: the process
has the rights of the server's user.
"""

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, Self

from race_server.core.driver import ENTRY_POINTS
from race_server.errors import DriverError
from race_server.logs import Log, last_words
from race_server.session.session import Session

# The distribution whose drivers are trusted.
OURS = "race-server"
# A driver has this long to get ready, and to end [s].
READY_S = 60.0
END_S = 5.0

# Returns the arguments of `race` that let a driver of a name drive a seat.
Command = Callable[[str, int], Sequence[str]]


def is_trusted(name: str) -> bool:
    """Return whether a driver may run inside a server: it came with it, and reads no file.

    What stands behind a colon may be the file of a policy, whose network may run without end.
    """
    points = [point for point in entry_points(group=ENTRY_POINTS) if point.name == name]
    return bool(points) and all(point.dist and point.dist.name == OURS for point in points)


def preset_of(name: str) -> str:
    """Return the observation that a driver wants, without importing it into this process.

    Raises:
        DriverError: it cannot be made, or takes too long.
    """
    code = (
        "import sys\nfrom race_server.core.driver import driver_named\n"
        "from race_server.errors import RaceError\n"
        "try: print(driver_named(sys.argv[1]).preset)\n"
        "except RaceError as error: sys.exit(str(error))\n"
    )
    command = [sys.executable, "-c", code, name]
    interpreted = {**os.environ, "RACE_SERVER_INTERPRET": "1"}
    try:
        done = subprocess.run(
            command, env=interpreted, capture_output=True, text=True, check=True, timeout=READY_S
        )
    except subprocess.TimeoutExpired as error:
        raise DriverError(f"driver {name!r} cannot be made within {READY_S:g} s") from error
    except subprocess.CalledProcessError as error:
        raise DriverError((error.stderr.strip().splitlines() or ["it said nothing"])[-1]) from error
    return done.stdout.split()[-1] if done.stdout.split() else ""


@dataclass
class _Process:
    name: str
    process: subprocess.Popen[bytes]
    stderr: Any
    ready_by: float  # [s] of `time.monotonic`
    is_seated: bool = False


@dataclass
class DriverProcesses:
    """The processes that drive seats of a session; they end with the block."""

    command: Command | None = None  # None: no driver runs as a process
    log: Log | None = None
    ready_s: float = READY_S
    _running: dict[int, _Process] = field(default_factory=dict)  # by seat

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    def __contains__(self, seat: object) -> bool:
        return seat in self._running

    def fill(self, session: Session, names: Sequence[str]) -> set[int]:
        """Start a process for each free seat whose driver is not trusted; return these seats.

        names: of drivers, repeated in turn.
        """
        started = set()
        for seat in session.seats.vacant() if self.command and names else ():
            name = names[seat.number % len(names)]
            if not is_trusted(name):
                self.start(name, seat.number)
                started.add(seat.number)
        return started

    def start(self, name: str, seat: int) -> None:
        """Start the process of a driver that takes a seat."""
        assert self.command is not None
        stderr = tempfile.NamedTemporaryFile(prefix="driver-")  # noqa: SIM115  # ends with it
        process = subprocess.Popen(
            [sys.executable, "-m", "race_server", *self.command(name, seat)],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
            stderr=stderr,
            start_new_session=True,  # Ctrl-C is for the server
        )
        self._running[seat] = _Process(name, process, stderr, time.monotonic() + self.ready_s)

    def are_coming(self, session: Session) -> bool:
        """Return whether drivers are still to get ready; end and log those that take too long."""
        coming = False
        for number, driver in list(self._running.items()):
            seat = session.seats[number]
            if driver.is_seated:
                continue
            if driver.process.poll() is not None:
                self._give_up(number, last_words(Path(driver.stderr.name)))
            elif seat.is_taken and seat.is_ready:
                driver.is_seated = True
            elif time.monotonic() > driver.ready_by:
                self._give_up(number, f"it was not ready within {self.ready_s:g} s")
            else:
                coming = True
        return coming

    def _give_up(self, seat: int, why: str) -> None:
        driver = self._running.pop(seat)
        _end([driver])
        if self.log is not None:
            self.log.warn("a driver cannot take part", seat=seat, driver=driver.name, why=why)

    def end(self) -> list[int]:
        """End all processes; return the seats that they had."""
        drivers, self._running = self._running, {}
        _end(list(drivers.values()))
        return [seat for seat, driver in drivers.items() if driver.is_seated]


def _end(drivers: list[_Process]) -> None:
    """End processes: with SIGTERM, after a timeout with SIGKILL."""
    for driver in drivers:
        driver.process.terminate()
    deadline = time.monotonic() + END_S
    for driver in drivers:
        try:
            driver.process.wait(max(deadline - time.monotonic(), 0.1))
        except subprocess.TimeoutExpired:
            driver.process.kill()
            driver.process.wait()
        driver.stderr.close()
