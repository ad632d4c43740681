"""Size and rate limits of the messages of clients and peers, made from the table of topics."""

from typing import Any

from race_server.net.wire.topics import EVERY, PEER, RECENT, TOPICS, Topic, key_of

# zenoh drops messages larger than twice a topic's limit before Python sees them. Those between
# are dropped and counted by the server. The margin [bytes] is for the badge.
SIZE_MARGIN = 64


def size_filter(session: str) -> list[dict[str, Any]]:
    """Return zenoh's size filter for messages of clients."""
    return [_size_of(topic, session) for topic in _sent()]


def peer_size_filter(session: str) -> list[dict[str, Any]]:
    """Return zenoh's size filter for messages of other karts."""
    return [_size_of(PEER, session)]


def _size_of(topic: Topic, session: str) -> dict[str, Any]:
    return {
        "id": f"size of {topic.key}",
        "messages": [_message(topic)],
        "flows": ["ingress"],
        "key_exprs": [key_of(topic, session, EVERY)],
        "size_limit": 2 * topic.most_bytes + SIZE_MARGIN,
    }


def rate_limit(session: str, seats: int, *, real_time: bool) -> list[dict[str, Any]]:
    """Return zenoh's rate limits for messages of clients.

    zenoh counts per rule and client, so two keys under one rule would starve each other: each
    key has its own rule.

    real_time: controls are limited too, words of a coach, and requests for the events. In lock-step
    their rate is that of the world: `RemoteRace` asks for the events of each decision.
    """
    return [
        _rate_of(topic, session, range(-1, seats) if topic.is_seats else range(-1, 0))
        for topic in _sent()
        if topic.limit_hz
        and (real_time or not (topic.direction in {"up", "coach"} or topic is RECENT))
    ]


def peer_rate_limit(session: str, others: range) -> list[dict[str, Any]]:
    """Return zenoh's rate limit for messages of other karts, from these seats."""
    return [_rate_of(PEER, session, others)]


def _rate_of(topic: Topic, session: str, seats: range) -> dict[str, Any]:
    return {
        "id": f"rate of {topic.key}",
        "messages": [_message(topic)],
        "flows": ["ingress"],
        "rules": [
            {"key_expr": key_of(topic, session, seat), "freq": topic.limit_hz} for seat in seats
        ],
    }


def _sent() -> list[Topic]:
    sent = {"up", "coach", "query", "admin"}
    return [topic for topic in TOPICS if topic.direction in sent and not topic.is_token]


def _message(topic: Topic) -> str:
    return "put" if topic.direction in {"up", "coach", "peer"} else "query"
