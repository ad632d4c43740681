"""A driver that never returns: as a process, inside the server, and in a server that is to end.

The driver is of a foreign package, which is on the path of the server of this drill only. A package
that offers a driver would have all kernels compiled again, so they are interpreted here: what
counts is that ticks go on, not how many.
"""

import os
import signal
import subprocess
import time
import urllib.error
import urllib.request
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from race_server.core.messages import Phase
from race_server.live.watchdog import HUNG_S
from race_server.tools.drills.report import Finding, SmallDrill, matrix_of
from race_server.tools.drills.server_process import ServerProcess, server_process, wait_until

SMALL = SmallDrill("", 30, "ok")

# It decides for two seconds, then waits in C with the interpreter lock.
DRIVER = """
import ctypes
from race_server.core.messages import Control
class Hanging:
    preset = "line"
    def reset(self, briefing):
        self.decisions = 0
    def act(self, observation):
        self.decisions += 1
        if self.decisions > 40:
            ctypes.PyDLL(None).pause()
        return Control(throttle=0.2)
"""
WORDS = ("--track", "oval", "--karts", "2", "--laps", "1000", "--fill", "hanging,pure_pursuit")
WATCH_S = 8.0
# From the first silent moment to the server that goes on without the driver [s].
RESTART_S = HUNG_S + 20.0
END_S = 3.0


def drill_hang(tell: Callable[[int], None] = lambda _: None) -> dict[str, Any]:
    """Let a driver hang in three servers and return the document."""
    with TemporaryDirectory(prefix="drill-") as name:
        place = Path(name)
        environment = _install(place)
        findings = []
        for number, part in enumerate((_as_process, _inside, _while_ending), start=1):
            findings.append(part(place, environment))
            tell(number)
    return matrix_of(findings)


def _install(place: Path) -> dict[str, str]:
    """Write the package of the driver, and return the environment of a server that finds it."""
    about = place / "foreign-1.dist-info"
    about.mkdir()
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: foreign\nVersion: 1\n")
    (about / "entry_points.txt").write_text("[race_server.drivers]\nhanging = foreign:Hanging\n")
    (place / "foreign.py").write_text(DRIVER)
    more = {"RACE_SERVER_INTERPRET": "1", "PYTHONWARNINGS": "ignore", "PYTHONPATH": str(place)}
    return {**os.environ, **more}


def _as_process(_: Path, environment: dict[str, str]) -> Finding:
    words = [*WORDS, "--wait-for", "0", "--record", "none"]
    with server_process(words, environment=environment) as server:
        server.wait_for(Phase.RUNNING)

        def silent_s(seat: int) -> float:
            return server.figures().get(f'race_silent_seconds_total{{seat="{seat}"}}', 0.0)

        wait_until(lambda: silent_s(0) > 1.0, 60.0, "the silence of the driver that hangs")
        ticks, other = server.figures()["race_ticks_total"], silent_s(1)
        time.sleep(WATCH_S)
        grown, more = server.figures()["race_ticks_total"] - ticks, silent_s(1) - other
        health = _health(server)
        server.stop()
    seen = f"health {health}, {grown:.0f} ticks, the other driver silent for {more:.1f} s"
    ok = health == "ok" and grown > 60 and more < 1.0
    return Finding("a driver hangs as a process", "the others race on", seen, ok)


def _inside(place: Path, environment: dict[str, str]) -> Finding:
    with _hung_server(place / "inside", environment) as server:
        begun = time.monotonic()
        wait_until(lambda: "left out" in server.text(), RESTART_S, "another server process")
        server.wait_for(Phase.RUNNING)
        taken_s = time.monotonic() - begun
        ticks = server.figures()["race_ticks_total"]
        time.sleep(2.0)
        grown = server.figures()["race_ticks_total"] - ticks
        server.stop()
    seen = f"it races again after {taken_s:.0f} s, {grown:.0f} ticks in 2 s"
    ok = grown > 20 and taken_s < RESTART_S
    return Finding("a driver hangs inside the server", "the race goes on without it", seen, ok)


def _while_ending(place: Path, environment: dict[str, str]) -> Finding:
    with _hung_server(place / "ending", environment) as server:
        server.server.send_signal(signal.SIGTERM)
        time.sleep(0.5)
        begun = time.monotonic()
        server.server.send_signal(signal.SIGTERM)
        try:
            server.server.wait(END_S)
        except subprocess.TimeoutExpired:
            return Finding("SIGTERM twice while it hangs", "it ends", "it goes on", ok=False)
    seen = f"it ends after {time.monotonic() - begun:.1f} s"
    return Finding("SIGTERM twice while it hangs", "it ends", seen, ok=True)


@contextmanager
def _hung_server(folder: Path, environment: dict[str, str]) -> Iterator[ServerProcess]:
    """Return a guarded server that runs its drivers inside, once one of them hangs."""
    words = [*WORDS, "--wait-for", "0", "--one-process", "--record", str(folder)]
    with server_process(words, environment=environment, is_guarded=True) as server:
        server.wait_for(Phase.COUNTDOWN)  # the driver decides from then on
        wait_until(lambda: _health(server) != "ok", 60.0, "a server that hangs")
        yield server


def _health(server: ServerProcess) -> str:
    """Return what a server says of its health, "no answer" where it says nothing."""
    opener = urllib.request.build_opener(urllib.request.ProxyHandler({}))
    try:
        with opener.open(f"http://127.0.0.1:{server.port}/healthz", timeout=1.0) as answer:
            return str(answer.read().decode().strip())
    except urllib.error.HTTPError as error:
        return error.read().decode().strip()
    except OSError:
        return "no answer"
