"""A client with a raw zenoh session that keeps to no rule of our own client."""

import itertools
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Self

import zenoh

from race_server.net.auth.keys import ClientKeys
from race_server.net.auth.settings import client_settings
from race_server.net.transport import open_session
from race_server.tools.drills.served_session import SESSION

# Messages that pass arrive within a millisecond on one machine.
SETTLE_S = 0.25
ANSWER_S = 0.4
LOGIN_S = 0.7
# Sooner after another one, a message may be refused by the rate limit instead of by the rule.
PACE_S = 0.02

_numbers = itertools.count()


def key(name: str) -> str:
    """Return a key of the drill's session."""
    return f"race/{SESSION}/{name}"


def mark() -> bytes:
    """Return a payload that is unique."""
    return f"intruder {next(_numbers)}".encode()


@dataclass
class Ears:
    """Payloads that arrived at one place."""

    heard: set[bytes] = field(default_factory=set)
    count: int = 0

    def hear(self, payload: bytes) -> None:
        """Record a payload."""
        self.count += 1
        self.heard.add(payload)

    def hear_at(self, _: str, payload: bytes) -> None:
        """Record a payload of any topic."""
        self.hear(payload)


class Intruder:
    """A raw connection with given keys."""

    def __init__(self, address: str, keys: ClientKeys | None, **changes: Any) -> None:
        """Connect; `changes` replace zenoh's settings.

        Raises:
            ZError: the connection is refused.
        """
        settings = client_settings(address, keys, LOGIN_S) | changes
        self.session = open_session(settings)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.session.close()

    def put(self, name: str) -> bytes:
        """Put a marked payload on a key and return it."""
        time.sleep(PACE_S)
        payload = mark()
        self.session.put(key(name), payload)
        return payload

    def ask(self, full_key: str, payload: bytes = b"") -> bytes | None:
        """Return the answer to a query, None without one."""
        time.sleep(PACE_S)
        with suppress(zenoh.ZError):
            for reply in self.session.get(full_key, payload=payload, timeout=ANSWER_S):
                if reply.ok is not None:
                    return bytes(reply.ok.payload.to_bytes())
        return None

    def overhears(self, full_key: str, provoke: Callable[[], None]) -> bool:
        """Return whether a subscription receives anything that `provoke` causes."""
        ears = Ears()
        subscriber = self.session.declare_subscriber(
            full_key, lambda sample: ears.hear(sample.payload.to_bytes())
        )
        time.sleep(SETTLE_S)
        provoke()
        time.sleep(SETTLE_S)
        subscriber.undeclare()
        return ears.count > 0


def is_let_in(address: str, keys: ClientKeys | None, **changes: Any) -> bool:
    """Return whether a connection with these keys is accepted."""
    try:
        with Intruder(address, keys, **changes):
            return True
    except zenoh.ZError:
        return False
