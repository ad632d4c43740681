"""Strangers who open connection after connection, with and without a front before the server.

The server is a real one with keys, in the middle of a race. Through the front, connections come
from the very address of the honest clients, except those that begin a handshake: an address that
breaks off handshakes is refused for a minute. Without the front logins may wait; the race may not.
"""

import contextlib
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from threading import Thread
from typing import Any

from race_server.competition.launch import free_port
from race_server.core.messages import Phase
from race_server.errors import LinkError, RaceError
from race_server.net.auth.issue import Order, issue_keys
from race_server.net.auth.keys import read_client_keys
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.topics import key_of
from race_server.tools.drills.front import front_of, missing_front
from race_server.tools.drills.intruder import Intruder
from race_server.tools.drills.report import SmallDrill, document_of, skipped
from race_server.tools.drills.server_process import (
    SESSION,
    ServerProcess,
    excess_of_missed,
    server_process,
    ticks_between,
)
from race_server.tools.drills.strangers import HELLO, IDLE, JUNK

SMALL = SmallDrill("--seconds 3", 40, "login_s")
TRACK, KARTS, FILLERS = "oval-report", 8, "pure_pursuit"
QUIET_S = 15.0  # of the same race before, as the yardstick
SETTLE_S = 1.0  # after the attack has begun, before the first login
MOST_LOGIN_S = 1.0
# After junk that came past the front.
MOST_RECOVERY_S = 60.0
# Silent connections for each that sends junk.
IDLE_SHARE = 6
# The address of those that begin a handshake.
ELSEWHERE = "127.0.0.2"
# Spectators that ask for everything, and the pause of each between two rounds [s]: 1000 requests
# a second each, five times what any key may get from one client.
CROWD, CROWD_PAUSE_S = 7, 0.005
SHARED = tuple(topic for topic in topics.QUERIES if topic.is_shared)


@dataclass(frozen=True)
class Attack:
    """One kind of connection, and where it goes."""

    name: str
    kind: str
    share: float  # of the rate of junk
    source: str = "127.0.0.1"
    is_direct: bool = False  # past the front


ATTACKS = (
    Attack("junk", JUNK, 1.0),
    Attack("idle", IDLE, IDLE_SHARE),
    Attack("handshakes of another address", HELLO, 1.0, ELSEWHERE),
    Attack("idle, without the front", IDLE, IDLE_SHARE, ELSEWHERE, is_direct=True),
    Attack("junk, without the front", JUNK, 1.0, ELSEWHERE, is_direct=True),
)


@dataclass
class _Site:
    """A server with keys, its ports, and what was wrong."""

    keys: Path
    place: ServerProcess
    ports: tuple[int, int, int, int]  # server, its steward's address, and both of the front
    faults: list[str] = field(default_factory=list)

    def login_s(self, role: str, port: int) -> float:
        """Return the time until a client has logged in and has an answer [s]."""
        begun = time.monotonic()
        keys = read_client_keys(self.keys / role)
        address = f"tls/127.0.0.1:{port}"
        with suppress(LinkError), ClientLink(address, SESSION, keys=keys, timeout_s=5.0) as link:
            link.ask(topics.TABLE)
        return round(time.monotonic() - begun, 3)

    def recovery_s(self, port: int) -> float:
        """Return the time from now until a login takes no longer than it may [s]."""
        begun = time.monotonic()
        while self.login_s("spectator", port) > MOST_LOGIN_S:
            if time.monotonic() > begun + MOST_RECOVERY_S:
                self.faults.append(f"no login within {MOST_RECOVERY_S:g} s after the attacks")
                break
        return round(time.monotonic() - begun, 1)


def drill_flood(
    junk: int, seconds: float = 8.0, *, tell: Callable[[int], None] = lambda _: None
) -> dict[str, Any]:
    """Open `junk` connections a second for `seconds` of each kind, and return the figures."""
    if reason := missing_front():
        return skipped(reason)
    ports = server, own, public, steward = free_port(), free_port(), free_port(), free_port()
    with tempfile.TemporaryDirectory(prefix="drill-") as folder:
        keys = Path(folder, "keys")
        issue_keys(Order(SESSION, KARTS), keys)
        words = ["--track", TRACK, "--karts", str(KARTS), "--laps", "1000", "--record", "none"]
        words += ["--open", "--keys", str(keys), "--fill", FILLERS, "--wait-for", "0"]
        words += ["--listen", f"tls/127.0.0.1:{server}"]
        words += ["--steward-listen", f"tls/127.0.0.1:{own}"]
        with server_process(words) as place, front_of(server, own, public, steward):
            site = _Site(keys, place, ports)
            try:
                place.wait_for(Phase.RUNNING)
                requests = ask_too_much(keys, server, seconds)
                rows = _attack_all(site, junk, seconds, tell)
                recovery_s = site.recovery_s(public)
                place.stop()
            except RaceError as error:
                return document_of([str(error)], junk_per_s=junk)
    if requests["answered"] < requests["asked"]:
        site.faults.append(f"{requests['answered']} of {requests['asked']} requests were answered")
    through = [row for row, attack in zip(rows, ATTACKS, strict=True) if not attack.is_direct]
    return document_of(
        site.faults,
        junk_per_s=junk,
        login_s=max(row["login_s"] for row in through),
        steward_login_s=max(row["steward_login_s"] for row in rows),
        missed_ticks=sum(row["missed_ticks"] for row in rows),
        recovery_s=recovery_s,
        idle_connections=max(row["most_open"] for row in rows),
        server_files=max(row["server_files"] for row in rows),
        **{f"honest_requests_{name}": count for name, count in requests.items()},
        attacks=rows,
    )


def _attack_all(
    site: _Site, junk: int, seconds: float, tell: Callable[[int], None]
) -> list[dict[str, Any]]:
    before = site.place.figures()
    time.sleep(QUIET_S)
    quiet = (before, site.place.figures())
    rows = []
    for number, attack in enumerate(ATTACKS):
        rows.append(_attack(site, attack, junk, seconds))
        tell(number + 1)
    if excess := excess_of_missed(quiet, (quiet[1], site.place.figures())):
        site.faults.append(excess)
    return rows


def _attack(site: _Site, attack: Attack, junk: int, seconds: float) -> dict[str, Any]:
    server, _, public, steward = site.ports
    port = server if attack.is_direct else public
    words = [attack.source, port, attack.kind, attack.share * junk, seconds]
    command = [sys.executable, "-m", "race_server.tools.drills.strangers", *map(str, words)]
    before, logins, stewards, files = site.place.figures(), [], [], 0.0
    begun = time.monotonic()
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        time.sleep(SETTLE_S)
        while process.poll() is None and time.monotonic() < begun + seconds:
            logins += [] if attack.is_direct else [site.login_s("spectator", public)]
            stewards.append(site.login_s("steward", steward))
            files = max(files, site.place.figures()["process_open_fds"])
            time.sleep(0.2)
        said = process.communicate()[0]
    after = site.place.figures()
    row = {
        "attack": attack.name,
        "login_s": max(logins, default=None),
        "steward_login_s": max(stewards),
        "missed_ticks": round(ticks_between(before, after)[1]),
        "server_files": round(files),
        **json.loads(said),
    }
    _judge(site, attack.name, row)
    return row


def ask_too_much(keys: Path, port: int, seconds: float) -> dict[str, int]:
    """Let spectators ask all that they may as fast as they can; count the answers to another one.

    Of eight places they have all but one.
    """
    address, role = f"tls/127.0.0.1:{port}", read_client_keys(keys / "spectator")
    asked = answered = 0
    with contextlib.ExitStack() as stack:
        honest = stack.enter_context(ClientLink(address, SESSION, keys=role))
        crowd = [stack.enter_context(Intruder(address, role)) for _ in range(CROWD)]
        end = time.monotonic() + seconds
        threads = [Thread(target=_ask_until, args=(intruder, end)) for intruder in crowd]
        for thread in threads:
            thread.start()
        while time.monotonic() < end:
            for topic in SHARED:
                asked += 1
                with suppress(LinkError):
                    answered += bool(honest.ask(topic))
        for thread in threads:
            thread.join()
    return {"asked": asked, "answered": answered}


def _ask_until(intruder: Intruder, end: float) -> None:
    while time.monotonic() < end:
        for topic in SHARED:
            intruder.session.get(key_of(topic, SESSION), lambda _: None)
        time.sleep(CROWD_PAUSE_S)


def _judge(site: _Site, name: str, row: dict[str, Any]) -> None:
    for who in ("login_s", "steward_login_s"):
        if (row[who] or 0.0) > MOST_LOGIN_S:
            site.faults.append(f"{name}: {who} {row[who]:g} s, {MOST_LOGIN_S:g} s are allowed")
    # A listener that is paused after the attack before lets none of the next one in.
    if not row["opened"] + row["failed"]:
        site.faults.append(f"{name}: no connection was tried")
