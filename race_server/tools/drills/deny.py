"""Try every forbidden act against an open session, and every legal one.

The server is a real one with fresh keys, in this process, so that the drill sees what reaches it.
Attackers speak zenoh themselves and keep to none of our client's rules.
"""

import io
import json
import time
from collections.abc import Callable, Iterator
from typing import Any

from race_server.errors import LinkError, Reason
from race_server.logs import FIRST, Log
from race_server.net.auth.settings import ListenSettings, check_listen_settings
from race_server.tools.drills import logins, messages, requests
from race_server.tools.drills.report import Finding, SmallDrill, matrix_of
from race_server.tools.drills.scene import Scene, scene_of
from race_server.tools.drills.served_session import served_session

SMALL = SmallDrill("", 18, "acts")


def drill_deny() -> dict[str, Any]:
    """Return the document of `race drill deny`."""
    begun = time.perf_counter()
    said = io.StringIO()
    findings = list(_refused_logins())
    with Log(stream=said) as log:
        with scene_of(log) as scene:
            for part in (*_PARTS, logins.try_too_many, logins.try_revoked):
                part(scene)
            refused = dict(scene.served.server.counters.refused)
        findings += scene.findings
    findings.append(_told_once(said.getvalue()))
    with served_session(1, 1, "tcp") as served:
        findings += logins.try_passwords_only(served)
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


def _refused_logins() -> Iterator[Finding]:
    """Yield how a server without keys treats addresses that other machines can reach."""
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
    told = [f"{r['reason']} of {r.get('seat')}" for r in rows if r["event"] == FIRST]
    twice = sorted({words for words in told if told.count(words) > 1})
    missing = [
        word for word in (Reason.SECOND_LOGIN, Reason.AGAIN) if not any(word in x for x in told)
    ]
    seen = f"{len(told)} lines"
    seen += f", twice: {twice}" if twice else ""
    seen += f", missing: {missing}" if missing else ""
    return Finding("refusals in the log", "one line each", seen, not twice and not missing)
