"""Access rules, made from the table of topics. What no rule allows is denied.

Rules are zenoh's: messages of a kind, on keys, into the server (ingress) or out of it (egress).
The server is the only router, so nothing passes from client to client unless two rules let it.
Real karts are peers of one another, without a router: each has such rules for the others.
"""

from dataclasses import dataclass
from typing import Any

from race_server.net.wire.topics import EVERY, PEER, TOPICS, Topic, key_of

SPECTATOR, STEWARD = "spectator", "steward"
# For each kind of rule: where it acts, which messages it allows. Clients learn of queryables and
# subscribers of the server only to know what to send.
_KINDS = {
    "send": (["ingress"], ["put"]),
    "live": (["ingress"], ["liveliness_token"]),
    "listen": (["ingress"], ["declare_subscriber"]),
    "hear": (["egress"], ["put"]),
    "ask": (["ingress"], ["query"]),
    "be answered": (["egress"], ["reply", "declare_queryable"]),
    "be wanted": (["egress"], ["declare_subscriber"]),
}


@dataclass(frozen=True)
class Role:
    """A kind of client that may connect.

    seat: a seat's number, `EVERY` for all of them, "" for none.
    """

    name: str
    seat: int | str = ""
    is_steward: bool = False


def roles_of(seats: int) -> tuple[Role, ...]:
    """Return the roles of an open session."""
    drivers = tuple(Role(seat_name(seat), seat) for seat in range(seats))
    return (*drivers, Role(SPECTATOR), Role(STEWARD, is_steward=True))


# On loopback without keys: any seat and, with the token, the steward's requests too.
ANYONE = Role("anyone", EVERY, is_steward=True)


def seat_name(seat: int) -> str:
    """Return the role's name of a seat."""
    return f"seat-{seat}"


def common_name(session: str, role: str) -> str:
    """Return the name in a role's certificate, also its user name."""
    return f"{session}-{role}"


def keys_allowed(session: str, role: Role) -> dict[str, list[str]]:
    """Return the keys that a role is allowed, by kind of rule."""
    allowed: dict[str, list[str]] = {kind: [] for kind in _KINDS}
    for topic in TOPICS:
        seat = role.seat if topic.is_seats else -1
        if topic.direction == "coach" and role.is_steward:
            for kind in ("send", "be wanted"):
                allowed[kind].append(key_of(topic, session, EVERY))
        for kind in _kinds_of(topic, role):
            allowed[kind].append(key_of(topic, session, seat))
    return {kind: keys for kind, keys in allowed.items() if keys}


def _kinds_of(topic: Topic, role: Role) -> tuple[str, ...]:
    if topic.direction == "peer" or (topic.is_seats and role.seat == ""):
        return ()
    if topic.direction == "up":
        return ("live",) if topic.is_token else ("send", "be wanted")
    if topic.direction in {"down", "out", "coach"}:
        return ("listen", "hear")
    if topic.direction == "admin" and not role.is_steward:
        return ()
    return ("ask", "be answered")


def access_control(
    session: str, roles: tuple[Role, ...], *, passwords: bool, certificates: bool
) -> dict[str, Any]:
    """Return zenoh's access control for roles, identified by user name, certificate or both."""
    allowed = {role: keys_allowed(session, role) for role in roles}
    return _control_of(session, allowed, passwords=passwords, certificates=certificates)


def peer_access_control(session: str, own: int, others: range, *, keys: bool) -> dict[str, Any]:
    """Return zenoh's access control of a real kart among its peers.

    own: its seat; others: seats that may be peers. With keys a certificate names the seat of each:
    no kart speaks for another one. Without them, on one machine, any peer does for all.
    """
    every, mine = key_of(PEER, session, EVERY), key_of(PEER, session, own)
    told = {"listen": [every], "be wanted": [every], "hear": [mine]}
    if not keys:
        return _control_of(
            session, {ANYONE: {"send": [every], **told}}, passwords=False, certificates=False
        )
    allowed = {
        Role(seat_name(seat), seat): {"send": [key_of(PEER, session, seat)], **told}
        for seat in others
        if seat != own
    }
    return _control_of(session, allowed, passwords=False, certificates=True)


def _control_of(
    session: str,
    allowed: dict[Role, dict[str, list[str]]],
    *,
    passwords: bool,
    certificates: bool,
) -> dict[str, Any]:
    """Return zenoh's access control for what each role is allowed, by kind of rule."""
    rules, subjects, policies = [], [], []
    for role, kinds in allowed.items():
        own = []
        for kind, keys in kinds.items():
            flows, messages = _KINDS[kind]
            own.append(f"{role.name} may {kind}")
            rules.append(
                {
                    "id": own[-1],
                    "permission": "allow",
                    "flows": flows,
                    "messages": messages,
                    "key_exprs": keys,
                }
            )
        subject: dict[str, Any] = {"id": role.name}
        name = [common_name(session, role.name)]
        # Where both are given, both must match: a stolen certificate needs its password too.
        subject |= {"usernames": name} if passwords else {}
        subject |= {"cert_common_names": name} if certificates else {}
        subjects.append(subject)
        policies.append({"rules": own, "subjects": [role.name]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": subjects,
        "policies": policies,
    }
