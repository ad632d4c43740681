"""A whole race in one command: a server process, a process for each driver, and the leaderboard."""

import contextlib
import json
import random
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from rich.console import Group
from rich.live import Live
from rich.text import Text

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.kernels.jit import is_compiled
from race_server.core.messages import Event, EventKind, Flag, Phase
from race_server.errors import LinkError, RaceError
from race_server.live.client.leaderboard import Headline, event_text, leaderboard
from race_server.live.client.spectator import Spectator
from race_server.logs import last_words, warnings_in
from race_server.net.transport import ClientLink
from race_server.net.wire.spectate import StandingsFrame
from race_server.terminal import Console

# Lines of events under the leaderboard.
_EVENT_LINES = 8
# From this age on, what spectators see is marked as old [s].
OLD_S = 0.5
# Until a server answers [s]. The first race compiles, on a busy or small machine for minutes; a
# server that fails is noticed at once.
START_S = 600.0
# Signals that end a race, and would otherwise end this process before its own.
_ENDING = (signal.SIGTERM, signal.SIGHUP)
# Port of the page, if it is free.
PAGE_PORT = 8080


@dataclass
class ProcessGroup:
    """The processes of a race, all ended with it."""

    processes: list[subprocess.Popen[bytes]] = field(default_factory=list)
    aside: list[subprocess.Popen[bytes]] = field(
        default_factory=list
    )  # the race goes on without them

    def start(
        self,
        arguments: Sequence[str],
        log: Any,
        *,
        aside: bool = False,
        environment: Mapping[str, str] | None = None,
    ) -> subprocess.Popen[bytes]:
        """Start ``race`` with these arguments.

        aside: its failure does not end the race; environment: None for that of this process.
        """
        command = [sys.executable, "-m", "race_server", *arguments]
        # In a separate process session, so that Ctrl-C reaches this process first.
        process = subprocess.Popen(
            command,
            stdin=subprocess.DEVNULL,
            stdout=log,
            stderr=log,
            start_new_session=True,
            env=environment,
        )
        (self.aside if aside else self.processes).append(process)
        return process

    def has_failed(self) -> bool:
        """Return whether a process has ended in error."""
        return any(process.poll() not in {None, 0} for process in self.processes)

    def end(self) -> None:
        """End the processes that still run: with SIGTERM, after a timeout with SIGKILL."""
        processes = [*self.processes, *self.aside]
        for process in processes:
            if process.poll() is None:
                process.send_signal(signal.SIGTERM)
        deadline = time.monotonic() + 5.0
        for process in processes:
            try:
                process.wait(max(deadline - time.monotonic(), 0.1))
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


@contextlib.contextmanager
def process_group() -> Iterator[ProcessGroup]:
    """Return a group whose processes end with the block, also where a signal ends it.

    Without that SIGTERM, or a terminal that is closed, would leave a race running.
    """
    group = ProcessGroup()
    before = {}
    if threading.current_thread() is threading.main_thread():
        before = {number: signal.signal(number, _leave) for number in _ENDING}
    try:
        yield group
    finally:
        group.end()
        for number, handler in before.items():
            signal.signal(number, handler)


def _leave(number: int, _frame: object) -> None:
    raise SystemExit(128 + number)


def free_address() -> str:
    """Return a free address of this machine."""
    return f"tcp/127.0.0.1:{free_port()}"


def free_port() -> int:
    """Return a free port of this machine."""
    # Below the ports that systems give to outgoing connections: one of those may be taken again
    # before the server listens.
    chance = random.SystemRandom()
    while True:
        port = chance.randrange(10_240, 32_000)
        if _is_free(port):
            return port


def _is_free(port: int) -> bool:
    with socket.socket() as probe:
        try:
            probe.bind(("127.0.0.1", port))
        except OSError:
            return False
    return True


@dataclass(frozen=True)
class TrackedSeat:
    """A seat with a real kart, and arguments of its `race plant`."""

    seat: int
    options: tuple[str, ...] = ()


@dataclass(frozen=True)
class RaceSpec:
    """A race to be run, in arguments of the command line."""

    serve: tuple[str, ...]  # arguments of `race serve`
    drivers: tuple[str, ...]  # one for each seat
    address: str
    session: str
    in_process: bool = False
    real: tuple[TrackedSeat, ...] = ()  # real karts, played by plants
    page: bool = False  # let browsers watch
    record: str = ""  # `--record` of the server


def run_race(plan: RaceSpec, console: Console) -> dict[str, Any]:
    """Run a race to its end and return the document that the server writes.

    `stopped` in it says whether Ctrl-C ended the race before its end, `warnings` what the server
    could not do, such as record it; they are printed, too.

    Raises:
        RaceError: the server cannot start, or ends without a result.
        KeyboardInterrupt: Ctrl-C ended the race before there was a result.
    """
    with tempfile.TemporaryDirectory(prefix="race-") as folder, process_group() as group:
        result, log_path = Path(folder, "result.json"), Path(folder, "server.log")
        with log_path.open("wb") as log:
            arguments = ["serve", *plan.serve, "--listen", plan.address, "--session", plan.session]
            arguments += ["--once", "--result", str(result)]
            if plan.in_process:
                arguments += ["--fill", ",".join(plan.drivers), "--wait-for", "0", "--one-process"]
            group.start(arguments, log)
            if not plan.in_process:
                _start_drivers(plan, group, log)
            page = _start_page(plan, group, log) if plan.page else ""
            stopped = _follow(plan, group, console, log_path, page)
        if not result.exists():
            if stopped:
                raise KeyboardInterrupt
            raise RaceError(f"the race ended without a result: {last_words(log_path)}")
        document: dict[str, Any] = json.loads(result.read_text())
        warnings = warnings_in(log_path)
        for sentence in warnings:
            console.print(Text(sentence, style="yellow"), soft_wrap=True)
        return {**document, "stopped": stopped, "warnings": warnings}


def _start_drivers(plan: RaceSpec, group: ProcessGroup, log: Any) -> None:
    """Start a process for each seat: a driver, or a plant with its driver."""
    plants = {real.seat: real.options for real in plan.real}
    meets = {seat: free_address() for seat in plants}
    for seat, name in enumerate(plan.drivers):
        ask = ["--connect", plan.address, "--session", plan.session, "--seat", str(seat)]
        ask += ["--patience", str(START_S)]
        if seat in plants:
            options = ["--driver", name, "--seed", str(seat + 1), *plants[seat]]
            options += ["--peers-at", meets[seat]]
            options += [
                word for other in plants.keys() - {seat} for word in ("--peer", meets[other])
            ]
            group.start(["plant", *options, *ask], log)
        else:
            group.start(["drive", name, *ask], log)


def _start_page(plan: RaceSpec, group: ProcessGroup, log: Any) -> str:
    """Start a gateway for browsers and return the address of its page."""
    place = f"127.0.0.1:{PAGE_PORT if _is_free(PAGE_PORT) else free_port()}"
    words = ["gateway", "--connect", plan.address, "--session", plan.session, "--listen", place]
    words += ["--once", *(["--recordings", plan.record] if plan.record else [])]
    group.start(words, log, aside=True)
    return f"http://{place}/"


def spread(real: int, karts: int) -> tuple[int, ...]:
    """Return `real` of `karts` seats, evenly spread."""
    return tuple((2 * number + 1) * karts // (2 * real) for number in range(real))


def _follow(
    plan: RaceSpec, group: ProcessGroup, console: Console, log_path: Path, page: str
) -> bool:
    """Show the leaderboard until the server ends; return whether Ctrl-C ended it.

    page: address for browsers, "" for none.
    """
    server = group.processes[0]
    waiting = "preparing"
    if not is_compiled():
        waiting = "compiling the simulation for this machine, once: about a minute"
    try:
        with console.status(waiting, spinner="dots"):
            seen = _watch(plan, group, log_path)
        if page and all(process.poll() is None for process in group.aside):
            console.print(f"watch it in a browser: {page}", soft_wrap=True)
        if seen is not None:
            with seen.link:
                _show(seen, group, console, plan, log_path)
        server.wait()
    except KeyboardInterrupt:
        # The server writes the results so far.
        console.print("stopping: results so far", style="yellow")
        server.send_signal(signal.SIGTERM)
        with contextlib.suppress(subprocess.TimeoutExpired):
            server.wait(10.0)
        return True
    return False


@dataclass(frozen=True)
class _Seen:
    """A running race, as a spectator sees it."""

    watcher: Spectator
    items: Sequence[str]
    link: ClientLink


def _watch(plan: RaceSpec, group: ProcessGroup, log_path: Path) -> _Seen | None:
    """Return the race once it answers; None if it ended before, as a short lockstep race may.

    Raises:
        RaceError: the server did not start.
        LinkError: it does not answer in time.
    """
    server, deadline = group.processes[0], time.monotonic() + START_S
    while server.poll() != 0:
        try:
            link = ClientLink(plan.address, plan.session, timeout_s=1.0)
        except LinkError as error:
            if group.has_failed():
                raise RaceError(f"the server did not start: {last_words(log_path)}") from error
            if time.monotonic() > deadline:
                raise
            continue
        try:
            watcher = Spectator(link)
            return _Seen(watcher, watcher.rules()[1], link)
        except LinkError:
            link.close()
            if time.monotonic() > deadline:
                raise
    return None


def _show(
    seen: _Seen, group: ProcessGroup, console: Console, plan: RaceSpec, log_path: Path
) -> None:
    """Draw the leaderboard a few times a second.

    Raises:
        RaceError: a driver failed before the start; after it, the race goes on without it.
    """
    server, watcher = group.processes[0], seen.watcher
    with Live(console=console, refresh_per_second=8, transient=True) as live:
        while server.poll() is None:
            live.update(board_of(watcher, plan.session, seen.items))
            frame = watcher.standings
            if group.has_failed() and (frame is None or frame.phase is Phase.LOBBY):
                raise RaceError(f"a driver could not take part: {last_words(log_path)}")
            time.sleep(0.12)


def board_of(
    watcher: Spectator, session: str, items: Sequence[str], final: StandingsFrame | None = None
) -> Group:
    """Return the leaderboard with the newest events below it. final: of a race that has ended."""
    frame = final or watcher.standings
    if frame is None:
        return Group(Text("waiting for the server"))
    snapshot = None if final else watcher.snapshot()
    tick = snapshot.tick if snapshot else frame.tick
    headline = Headline(
        session,
        frame.course,
        frame.laps,
        snapshot.phase if snapshot else frame.phase,
        Flag(snapshot.flag if snapshot else frame.flag),
        (tick - frame.start_tick) / TICKS_PER_SECOND,
    )
    names = [""] * 64
    for row in frame.rows:
        names[row.seat] = f"{row.driver} {row.seat}"
    told = [text for event in watcher.events if (text := _line(event, names, items))]
    lines = [Text(text, style="dim") for text in told[-_EVENT_LINES:]]
    age = watcher.age_s()
    if age is not None and final is None:
        style = "dim" if age < OLD_S else "bold red"
        lines.append(Text(f"as it was {1e3 * age:.0f} ms ago", style=style))
    return Group(leaderboard(headline, frame.rows), *lines)


def _line(event: Event, names: Sequence[str], items: Sequence[str]) -> str:
    if event.kind in {EventKind.SECTOR, EventKind.EFFECT_END, EventKind.PHASE}:
        return ""
    text = event_text(event, names, items)
    return f"{event.tick / TICKS_PER_SECOND:7.2f}  {text}" if text else ""
