"""Everything that nobody may do to an open session is tried, and everything that people may.

The server is a real one with fresh keys, in this process, so that the drill sees what reaches it.
Those who attack speak zenoh themselves and keep to none of our client's rules.
"""

import contextlib
import io
import json
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

from race_server.errors import LinkError
from race_server.live.client.seat import ClientSeat, take_seat
from race_server.logs import Log
from race_server.net.auth.settings import ListenSettings, check_listen_settings
from race_server.net.transport import ClientLink
from race_server.net.wire import topics
from race_server.net.wire.lobby import Join
from race_server.tools.drills import logins, messages, requests
from race_server.tools.drills.intruder import Ears
from race_server.tools.drills.report import Finding, matrix_of
from race_server.tools.drills.served_session import ServedSession, served_session

SEATS, SPECTATORS = 3, 4


@dataclass
class Scene:
    """The session under attack, who races honestly there, and what was found."""

    stage: ServedSession
    drivers: list[ClientSeat]
    watcher: ClientLink
    arrived: Ears  # what reached the server
    told: Ears  # what reached an honest spectator and an honest driver
    findings: list[Finding] = field(default_factory=list)

    def deny(self, act: str, seen: str) -> None:
        """Note a forbidden act; seen: "" for nothing, otherwise what came of it."""
        self.findings.append(Finding(act, "denied", seen or "denied", not seen))

    def allow(self, act: str, seen: str = "") -> None:
        """Note a legal act; seen: "" if it did what it should, otherwise what it did not."""
        self.findings.append(Finding(act, "allowed", seen or "allowed", not seen))

    def reached(self, payload: bytes) -> str:
        """Return whom a payload of an intruder reached, "" for nobody."""
        who = [("the server", self.arrived), ("others", self.told)]
        return " and ".join(f"reached {name}" for name, ears in who if payload in ears.heard)


def drill_deny() -> dict[str, Any]:
    """Return the document of `race drill deny`."""
    begun = time.perf_counter()
    said = io.StringIO()
    findings = list(_closed_doors())
    with Log(stream=said) as log:
        with _scene(log) as scene:
            for part in (*_PARTS, logins.try_full_house):
                part(scene)
            refused = dict(scene.stage.server.counters.refused)
        findings += scene.findings
    findings.append(_told_once(said.getvalue()))
    with served_session(1, 1, "tcp") as stage:
        findings += logins.try_passwords_only(stage)
    seconds = round(time.perf_counter() - begun, 1)
    return matrix_of(findings, acts=len(findings), seconds=seconds, refused=refused)


_PARTS: tuple[Callable[[Scene], None], ...] = (
    messages.try_legal,
    messages.try_puts,
    messages.try_listening,
    messages.try_presence,
    messages.try_limits,
    messages.try_replay,
    requests.try_requests,
    requests.try_forgery,
    requests.try_steward,
    logins.try_double_login,
    logins.try_logins,
)


@contextlib.contextmanager
def _scene(log: Log) -> Iterator[Scene]:
    """Start a race of honest drivers with an honest spectator."""
    with served_session(SEATS, SPECTATORS, log=log) as stage, contextlib.ExitStack() as stack:
        arrived, told = Ears(), Ears()
        stage.server.link.receive_everything(arrived.hear_at)
        links = [stack.enter_context(stage.link(f"seat-{seat}")) for seat in range(SEATS)]
        drivers = [
            take_seat(link, Join(f"honest {seat}", "track", seat))
            for seat, link in enumerate(links)
        ]
        watcher = stack.enter_context(stage.link("spectator"))
        for topic in (topics.SNAPSHOT, topics.EVENTS, topics.STANDINGS):
            watcher.listen(topic, told.hear)
        links[1].listen(topics.OBSERVATION, told.hear, 1)
        for driver in drivers:
            driver.act(topics.READY)
        yield Scene(stage, drivers, watcher, arrived, told)


def _closed_doors() -> Iterator[Finding]:
    """Yield what a server without keys does with addresses that others can reach."""
    for address in ("tcp/0.0.0.0:7447", "tcp/192.168.1.10:7447", "tls/127.0.0.1:7447"):
        try:
            check_listen_settings(ListenSettings(address, "race", 2))
            seen = "it would listen"
        except LinkError:
            seen = ""
        act = f"serve without keys on {address}"
        yield Finding(act, "denied", seen or "denied", not seen)


def _told_once(log: str) -> Finding:
    """Return whether each kind of refusal has one line in the log."""
    rows = [json.loads(line) for line in log.splitlines()]
    told = [f"{r['reason']} of {r.get('seat')}" for r in rows if r["event"].startswith("refused")]
    twice = sorted({words for words in told if told.count(words) > 1})
    missing = [word for word in ("second login", "again") if not any(word in x for x in told)]
    seen = f"{len(told)} lines"
    seen += f", twice: {twice}" if twice else ""
    seen += f", missing: {missing}" if missing else ""
    return Finding("refusals in the log", "one line each", seen, not twice and not missing)
