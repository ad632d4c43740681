"""Forbidden logins: wrong keys, no keys, those of others, twice, and one too many."""

import contextlib
import time
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from race_server.core.messages import Control
from race_server.errors import KeysError, Reason
from race_server.live.client.steward import StewardClient
from race_server.net.auth.issue import Order, issue_keys
from race_server.net.auth.keys import ClientKeys, read_client_keys, revoke_keys
from race_server.net.transport.link_limiter import FAREWELL_S, REVOKED_S
from race_server.net.wire.drive import ControlFrame, encode_control
from race_server.net.wire.lobby import Join, encode_join
from race_server.tools.drills.intruder import SETTLE_S, Intruder, is_let_in, key
from race_server.tools.drills.report import Finding
from race_server.tools.drills.requests import refusal_of
from race_server.tools.drills.scene import Scene
from race_server.tools.drills.served_session import SESSION, ServedSession

# Connections with the keys of one seat, which has two places.
MANY = 12
TLS = "transport/link/tls"
USER = "transport/auth/usrpwd"


def try_logins(scene: Scene) -> None:
    """Try logins that must be refused, and one that must have no effect."""
    served, own = scene.served, scene.served.keys("seat-0")
    with TemporaryDirectory() as name:
        rogue = _rogue(Path(name), own)
        for act, keys, changes in (
            (
                "certificate of another authority",
                replace(rogue, folder=rogue.folder),
                _trust(own, rogue),
            ),
            ("a server that these keys do not trust", rogue, {}),
            ("no certificate", own, {TLS: {"root_ca_certificate": str(own.folder / "ca.pem")}}),
            ("wrong password", replace(own, password="guessed"), {}),
            ("unknown user", replace(own, user="drill-seat-9"), {}),
            ("no password", own, {USER: {}}),
        ):
            scene.deny(act, "let in" if is_let_in(served.address, keys, **changes) else "")
    with Intruder(
        served.address, replace(own, user=own.user, folder=served.folder / "seat-1")
    ) as odd:
        payload = odd.put("in/0")
        time.sleep(SETTLE_S)
        scene.deny("own password with another's certificate", scene.reached(payload))
    try:
        read_client_keys(_expired(own), SESSION)
        scene.deny("keys that have expired", "taken")
    except KeysError:
        scene.deny("keys that have expired", "")


def _rogue(folder: Path, own: ClientKeys) -> ClientKeys:
    """Return keys of a stranger for a seat of the same name, with the right password."""
    issue_keys(Order(SESSION, own.seat + 1), folder / "keys")
    keys = read_client_keys(folder / "keys" / own.role)
    return replace(keys, password=own.password)


def _trust(own: ClientKeys, rogue: ClientKeys) -> dict[str, Any]:
    """Return settings that trust the server but show it a stranger's certificate."""
    return {
        TLS: {
            "root_ca_certificate": str(own.folder / "ca.pem"),
            "connect_certificate": str(rogue.folder / "certificate.pem"),
            "connect_private_key": str(rogue.folder / "key.pem"),
            "enable_mtls": True,
        }
    }


def _expired(own: ClientKeys) -> Path:
    about = own.folder / "keys.json"
    about.write_text(about.read_text().replace(own.expires, "2001-01-01T00:00:00+00:00"))
    return own.folder


def try_double_login(scene: Scene) -> None:
    """Try a copy of a driver's keys while the driver races."""
    session, server = scene.served.server.session, scene.served.server
    with Intruder(scene.served.address, scene.served.keys("seat-0")) as thief:
        time.sleep(SETTLE_S)
        noted = server.link.dropped[Reason.SECOND_LOGIN, 0]
        scene.allow("a second login is noted", "" if noted else "it was not")
        answer = thief.ask(key("q/join/0"), encode_join(Join("thief", "track", 0)))
        scene.deny("join with copied keys", "" if refusal_of(answer) else "not refused")
        seat = session.seats[0]
        sequence = seat.sequence
        control = ControlFrame(session.epoch, sequence + 1, 0, Control(brake=1.0))
        thief.session.put(key("in/0"), encode_control(control))
        time.sleep(SETTLE_S)
        scene.deny("control with copied keys", "it counted" if seat.sequence > sequence else "")
        token = thief.session.liveliness().declare_token(key("alive/0/00"))
        time.sleep(SETTLE_S)
        seen = server.link.holders.is_doubled(0)
        scene.allow("a token of the client's seat is seen", "" if seen else "it was not")
        token.undeclare()
        time.sleep(SETTLE_S)
        scene.deny("end the driver's presence", "" if seat.is_present else "the driver is gone")


def try_too_many(scene: Scene) -> None:
    """Try more connections with the keys of one seat than there are places for all keys."""
    served = scene.served
    keys, link = served.keys("seat-2"), served.server.link
    with contextlib.ExitStack() as stack:
        for _ in range(MANY):
            stack.enter_context(Intruder(served.address, keys))
        time.sleep(FAREWELL_S + SETTLE_S)
        closed = link.dropped[Reason.TOO_MANY_LINKS, 2]
        scene.deny("more connections than a key has places", "" if closed else "none was closed")
        with served.link("steward") as own:
            log = StewardClient(own, served.keys("steward").token).log()
            scene.allow("log in as steward meanwhile", "" if log else "no answer")


def try_revoked(scene: Scene) -> None:
    """Try keys that are revoked while the server runs."""
    served, link = scene.served, scene.served.server.link
    revoke_keys(served.folder, "seat-2")
    time.sleep(REVOKED_S + SETTLE_S)
    is_away = served.server.session.seats.is_sent_away(2)
    scene.deny("race on with revoked keys", "" if is_away else "the driver has its seat")
    before = link.dropped[Reason.BARRED_LINK, 2]
    with Intruder(served.address, served.keys("seat-2")):
        time.sleep(SETTLE_S)
        scene.deny(
            "log in with revoked keys",
            "" if link.dropped[Reason.BARRED_LINK, 2] > before else "stays",
        )
    others = all(served.server.session.seats[other].is_taken for other in (0, 1))
    scene.allow("the others keep their seats", "" if others else "they did not")


def try_passwords_only(served: ServedSession) -> list[Finding]:
    """Return what an open session without encryption refuses: passwords alone identify clients."""
    own = served.keys("seat-0")
    findings = []
    for act, keys in (
        ("wrong password, unencrypted", replace(own, password="guessed")),
        ("no password, unencrypted", None),
    ):
        seen = "let in" if is_let_in(served.address, keys) else ""
        findings.append(Finding(act, "denied", seen or "denied", not seen))
    with (
        Intruder(served.address, own) as seat,
        Intruder(served.address, served.keys("spectator")) as other,
    ):
        answer = seat.ask(key("q/join/0"), encode_join(Join("own", "track", 0)))
        granted = answer is not None and not refusal_of(answer)
        findings.append(
            Finding("join, unencrypted", "allowed", "allowed" if granted else "refused", granted)
        )
        taken = other.ask(key("q/join/0"), encode_join(Join("thief", "track", 0)))
        findings.append(
            Finding(
                "join as spectator, unencrypted",
                "denied",
                "granted" if taken else "denied",
                not taken,
            )
        )
    return findings
