"""The whole protocol on one screen.

Keys are ``race/<session>/…``. The seat in a key *is* the identity of who sends: access rules
are set on keys, and nothing in a message can claim another seat.
"""

import re
from dataclasses import dataclass

from race_server.errors import WireError


@dataclass(frozen=True)
class Topic:
    """One row of the protocol."""

    key: str  # below race/<session>/, with {seat} where each seat has its own
    message: str  # table in schemas/
    identifier: bytes  # of the FlatBuffer
    direction: str  # up: driver to server; down: server to seat; out: server to everybody; query
    rate: str
    most_bytes: int  # larger messages are dropped unread
    newest_wins: bool  # an older message that nobody has read yet is forgotten
    recorded: bool


CONTROL = Topic("in/{seat}", "ControlMessage", b"RCTL", "up", "20 Hz", 256, True, True)
POSE = Topic("pose/{seat}", "PoseMessage", b"RPOS", "up", "10–100 Hz", 256, True, True)
OBSERVATION = Topic("obs/{seat}", "SeatObservation", b"ROBS", "down", "20 Hz", 65536, True, False)
HUD = Topic("hud/{seat}", "Hud", b"RHUD", "down", "20 Hz", 1024, True, False)
SNAPSHOT = Topic("out/snapshot", "Snapshot", b"RSNP", "out", "60 Hz", 16384, True, True)
EVENTS = Topic("out/events", "Events", b"REVT", "out", "as they happen", 65536, False, True)
STANDINGS = Topic("out/standings", "Standings", b"RSTD", "out", "2 Hz", 262144, True, True)

JOIN = Topic("q/join", "JoinRequest → Briefing or Reply", b"RJRQ", "query", "", 512, False, True)
READY = Topic("q/ready", "SeatRequest → Reply", b"RSRQ", "query", "", 128, False, True)
LEAVE = Topic("q/leave", "SeatRequest → Reply", b"RSRQ", "query", "", 128, False, True)
COURSE = Topic("q/course", "→ Course", b"RCRS", "query", "", 0, False, True)
RULES = Topic("q/rules", "→ Rules", b"RRUL", "query", "", 0, False, True)
RECENT = Topic("q/events", "→ Events", b"REVT", "query", "", 0, False, False)
TABLE = Topic("q/standings", "→ Standings", b"RSTD", "query", "", 0, False, False)

# A liveliness token: present as long as the driver's link is.
ALIVE = Topic("alive/{seat}", "liveliness token", b"", "up", "", 0, False, True)

TOPICS = (
    CONTROL,
    POSE,
    OBSERVATION,
    HUD,
    SNAPSHOT,
    EVENTS,
    STANDINGS,
    JOIN,
    READY,
    LEAVE,
    COURSE,
    RULES,
    RECENT,
    TABLE,
    ALIVE,
)
QUERIES = tuple(topic for topic in TOPICS if topic.direction == "query")

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")


def key_of(topic: Topic, session: str, seat: int = -1) -> str:
    """Return the full key of a topic.

    Raises:
        WireError: the session's name is none.
    """
    if not _NAME.fullmatch(session):
        raise WireError(
            f"session name {session!r}: use up to 32 letters, digits, '-', '_' or '.', "
            "beginning with a letter or digit"
        )
    return f"race/{session}/{topic.key.format(seat=seat)}"
