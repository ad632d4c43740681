"""The whole protocol on one screen.

Keys are ``race/<session>/…``. The seat in a key identifies the sender: access rules
(`net/auth/access.py`) are made from this table, and no message contains another seat.

A *badge* identifies one connection of a seat; only the driver that joined knows it. It is the last
part of a liveliness token's key, and the attachment of each control.
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
    # up: driver to server; down: server to seat; out: server to all; query; admin: a query of a
    # steward; peer: kart to kart, never by a server; coach: a steward's program to a seat
    direction: str
    rate: str
    most_bytes: int  # larger messages are dropped without decoding
    newest_wins: bool  # replaces an older message that was not received yet
    recorded: bool
    limit_hz: float = 0.0  # messages above it from one client are dropped; 0: no limit

    @property
    def is_seats(self) -> bool:
        """Whether each seat has its own key."""
        return "{seat}" in self.key

    @property
    def is_shared(self) -> bool:
        """Whether all clients ask for the same: one answer is for all that wait."""
        return self.direction == "query" and not self.is_seats

    @property
    def is_token(self) -> bool:
        """Whether it is a liveliness token, not a message."""
        return not self.identifier


# Twice the ticks: a driver may decide at every tick, and senders are not exact.
CONTROL_HZ = 120.0
# Twice the highest rate of a real kart.
POSE_HZ = 200.0
# A kart tells what changed in each turn of its loop at most.
ALERT_HZ = 200.0
# Five a second, and one for each change of a sensor.
TELEMETRY_HZ = 50.0
# Twice the rate of a real kart.
PEER_HZ = 100.0
# Twice as often as a coach tells one driver something at most: a cue and the word after a lap may
# come together, and what follows sooner than this allows is dropped.
COACH_HZ = 200.0
# Twice the highest rates of `ClientLink`: for one client's own keys, and for what all may ask.
QUERY_HZ = 200.0
SHARED_HZ = 20.0


CONTROL = Topic("in/{seat}", "ControlMessage", b"RCTL", "up", "20 Hz", 256, True, True, CONTROL_HZ)
POSE = Topic("pose/{seat}", "PoseMessage", b"RPOS", "up", "10–100 Hz", 256, True, True, POSE_HZ)
ALERT = Topic(
    *("alert/{seat}", "AlertMessage", b"RALR", "up", "as it changes, 5 Hz while it lasts"),
    *(256, False, True, ALERT_HZ),
)
TELEMETRY = Topic(
    *("telemetry/{seat}", "TelemetryMessage", b"RTEL", "up", "5 Hz, and as a sensor fails"),
    *(256, True, True, TELEMETRY_HZ),
)
# What a real kart knows by itself: from its program to what is beside its driver, on the kart's own
# machine, with a server or without.
OWN_POSE = Topic("own/pose/{seat}", "PoseMessage", b"RPOS", "down", "50 Hz", 256, True, False)
OWN_ALERT = Topic("own/alert/{seat}", "AlertMessage", b"RALR", "down", "50 Hz", 256, True, False)
# From a real kart to all others: they are peers of one another, and need no server.
PEER = Topic("peer/{seat}", "PeerMessage", b"RPER", "peer", "50 Hz", 256, True, False, PEER_HZ)
OBSERVATION = Topic("obs/{seat}", "SeatObservation", b"ROBS", "down", "20 Hz", 65536, True, False)
# From a coach, which watches as spectators do, and has the keys of a steward.
COACH = Topic(
    *("coach/{seat}", "Hint", b"RHNT", "coach", "after each lap, and before corners"),
    *(1024, False, False, COACH_HZ),
)
HUD = Topic("hud/{seat}", "Hud", b"RHUD", "down", "20 Hz", 1024, True, False)
ORDER = Topic("order/{seat}", "ParkingOrder", b"RORD", "down", "2 Hz", 262144, True, False)
SNAPSHOT = Topic("out/snapshot", "Snapshot", b"RSNP", "out", "60 Hz", 16384, True, True)
EVENTS = Topic("out/events", "Events", b"REVT", "out", "as they happen", 65536, False, True)
STANDINGS = Topic("out/standings", "Standings", b"RSTD", "out", "2 Hz", 262144, True, True)
LINKS = Topic("out/links", "Links", b"RLNK", "out", "2 Hz", 4096, True, False)
ALERTS = Topic("out/alerts", "Alerts", b"RALS", "out", "as they change, 2 Hz", 4096, True, True)
TELEMETRIES = Topic(
    *("out/telemetry", "Telemetries", b"RTLS", "out", "5 Hz for each real kart"),
    *(4096, True, True),
)
LOT = Topic("out/lot", "Lot", b"RLOT", "out", "2 Hz", 131072, True, True)
PROGRAMME = Topic("out/programme", "Programme", b"RPRG", "out", "2 Hz", 131072, True, True)
GHOSTS = Topic("out/ghosts", "Ghosts", b"RGHO", "out", "0.5 Hz", 1 << 20, True, True)

# The seat is in the key, so that access rules distinguish seats; `any` for any free one.
JOIN = Topic(
    "q/join/{seat}",
    "JoinRequest → Briefing or Reply",
    b"RJRQ",
    "query",
    "",
    512,
    False,
    True,
    QUERY_HZ,
)
READY = Topic(
    "q/ready/{seat}", "SeatRequest → Reply", b"RSRQ", "query", "", 128, False, True, QUERY_HZ
)
LEAVE = Topic(
    "q/leave/{seat}", "SeatRequest → Reply", b"RSRQ", "query", "", 128, False, True, QUERY_HZ
)
PARK = Topic(
    "q/park/{seat}", "SeatRequest → Reply", b"RSRQ", "query", "", 128, False, True, QUERY_HZ
)
COURSE = Topic("q/course", "→ Course", b"RCRS", "query", "", 0, False, True, SHARED_HZ)
RULES = Topic("q/rules", "→ Rules", b"RRUL", "query", "", 0, False, True, SHARED_HZ)
LINE = Topic("q/line", "→ Line", b"RLIN", "query", "", 0, False, False, SHARED_HZ)
RECENT = Topic("q/events", "→ Events", b"REVT", "query", "", 0, False, False, SHARED_HZ)
TABLE = Topic("q/standings", "→ Standings", b"RSTD", "query", "", 0, False, False, SHARED_HZ)

ACT = Topic("admin/act", "AdminRequest → Reply", b"RADM", "admin", "", 1024, False, True, QUERY_HZ)
ACTS = Topic(
    "admin/log", "AdminRequest → AdminLog", b"RADM", "admin", "", 512, False, False, QUERY_HZ
)

# A liveliness token: present as long as the driver's link.
ALIVE = Topic("alive/{seat}/{badge}", "liveliness token", b"", "up", "", 0, False, True)

TOPICS = (
    CONTROL,
    POSE,
    ALERT,
    TELEMETRY,
    OWN_POSE,
    OWN_ALERT,
    PEER,
    COACH,
    OBSERVATION,
    HUD,
    ORDER,
    SNAPSHOT,
    EVENTS,
    STANDINGS,
    LINKS,
    ALERTS,
    TELEMETRIES,
    LOT,
    PROGRAMME,
    GHOSTS,
    JOIN,
    READY,
    LEAVE,
    PARK,
    COURSE,
    RULES,
    LINE,
    RECENT,
    TABLE,
    ACT,
    ACTS,
    ALIVE,
)
QUERIES = tuple(topic for topic in TOPICS if topic.direction in {"query", "admin"})

# In a key in place of a seat's number: any free seat, and all seats.
ANY, EVERY = "any", "*"

_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,31}")


def key_of(topic: Topic, session: str, seat: int | str = -1, badge: str = EVERY) -> str:
    """Return the full key of a topic; a seat of -1 is any.

    Raises:
        WireError: the session's name is not valid.
    """
    if not _NAME.fullmatch(session):
        raise WireError(
            f"session name {session!r}: use up to 32 letters, digits, '-', '_' or '.', "
            "beginning with a letter or digit"
        )
    place = ANY if seat == -1 else seat
    return f"race/{session}/{topic.key.format(seat=place, badge=badge)}"
