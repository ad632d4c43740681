"""Bounds what connections cost an open session: links of each key, and files.

zenoh has one bound on all links together, and accepts connections for as long as there are files.
So this thread counts: links beyond those of a key are closed, and links of keys that are barred.
Where too many connections wait for their handshake, the public listener is paused until there are
fewer. The steward's own address, if there is one, stays open; links of others are closed there.
"""

import threading
import time
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, Self

import zenoh

from race_server.errors import KeysError, Reason
from race_server.net.auth.keys import ServerKeys, read_revoked
from race_server.net.open_files import raise_open_files
from race_server.net.transport.sockets import (
    close_connections,
    count_files,
    listeners,
    pause_listener,
)

# Files that the server asks for. Connections in their handshake may have `HANDSHAKES` of those,
# and half of what remains when all links are open: recordings, results and metrics need some too.
OPEN_FILES = 4096
HANDSHAKES = 256
# Connections that wait in the system until zenoh accepts them.
QUEUE = 64
# Between two rounds [s]; many links begin one at once.
PERIOD_S = 0.1
REVOKED_S = 0.5  # between two looks at what is revoked
# A driver that is excluded hears why before its link is closed [s]. As long are links beyond the
# places of their key held, up to this number, because a client comes back at once.
FAREWELL_S = 1.0
MOST_HELD = 32


@dataclass(frozen=True)
class LinkLimits:
    """The limits that a link limiter holds each peer to.

    places: how many links each common name may have; steward: the one of the steward.
    """

    keys: ServerKeys
    places: Mapping[str, int]
    steward: str
    port: int  # of the public address
    steward_port: int = 0  # of the steward's own address; 0: none


@dataclass(frozen=True)
class OpenLink:
    """A link that is open."""

    name: str  # common name of its certificate
    peer: str  # its other end, such as 127.0.0.1:4711
    port: int  # that it came in by
    since: float  # time.monotonic [s]


@dataclass
class LinkLimiter:
    """Bounds the links of an open session from `open` to `close`.

    on_closed: called with the reason and the common name of each link that is closed.
    """

    limits: LinkLimits
    on_closed: Callable[[Reason, str], None]
    is_paused: bool = False  # the public listener
    _links: dict[tuple[str, int], OpenLink] = field(default_factory=dict)
    _barred: set[str] = field(default_factory=set)  # by the steward, until it lets them in again
    _revoked: frozenset[str] = frozenset()
    _news: threading.Event = field(default_factory=threading.Event)
    _closing: bool = False

    def __post_init__(self) -> None:
        """Count the places."""
        self._most_links = sum(self.limits.places.values())

    def open(self) -> Self:
        """Begin to watch."""
        files = raise_open_files(OPEN_FILES)
        self._most_files = min(count_files() + self._most_links + HANDSHAKES, files // 2)
        self._listeners = listeners(self.limits.port)
        for listener in self._listeners:
            listener.listen(QUEUE)
        self._thread = threading.Thread(target=self._watch, name="link-limiter", daemon=True)
        self._thread.start()
        return self

    def close(self) -> None:
        """Stop watching."""
        self._closing = True
        self._news.set()
        self._thread.join()
        for listener in self._listeners:
            listener.close()

    def note(self, event: zenoh.LinkEvent) -> None:
        """Record that a link has opened or closed; runs in a thread of zenoh."""
        link = event.link
        peer, port = _place(link.dst), _port(link.src)
        if event.kind == zenoh.SampleKind.PUT:
            name = link.auth_identifier or ""
            self._links[peer, port] = OpenLink(name, peer, port, time.monotonic())
            if len(self._links) > self._most_links:
                self._news.set()
        else:
            self._links.pop((peer, port), None)

    def bar(self, name: str, *, is_barred: bool = True) -> None:
        """Close the links of a common name until it is let in again."""
        (self._barred.add if is_barred else self._barred.discard)(name)

    @property
    def revoked(self) -> frozenset[str]:
        """The common names whose keys have been revoked."""
        return self._revoked

    def _watch(self) -> None:
        looked = 0.0
        while not self._closing:
            # Looking needs a file too. Without one the next round looks again.
            with suppress(OSError, KeysError):
                self._close_unwanted()
                self._watch_files()
                if time.monotonic() > looked + REVOKED_S:
                    looked = time.monotonic()
                    self._revoked = read_revoked(self.limits.keys.folder)
            self._news.wait(PERIOD_S)
            self._news.clear()

    def _close_unwanted(self) -> None:
        unwanted = {link.peer: (reason, link.name) for link, reason in self._unwanted()}
        if unwanted and close_connections(set(unwanted)):
            for reason, name in unwanted.values():
                self.on_closed(reason, name)

    def _unwanted(self) -> list[tuple[OpenLink, Reason]]:
        """Return the links to close, each with the reason."""
        now, taken, unwanted, held = time.monotonic(), Counter[str](), [], 0
        for link in sorted(self._links.copy().values(), key=lambda link: link.since):
            limits, reason = self.limits, None
            taken[link.name] += 1
            has_heard = now > link.since + FAREWELL_S
            if link.name in self._revoked or (link.name in self._barred and has_heard):
                reason = Reason.BARRED_LINK
            elif link.port == limits.steward_port and link.name != limits.steward:
                reason = Reason.STEWARD_ADDRESS
            elif taken[link.name] > limits.places.get(link.name, 0):
                held += 1
                reason = Reason.TOO_MANY_LINKS if has_heard or held > MOST_HELD else None
            if reason:
                unwanted.append((link, reason))
        return unwanted

    def _watch_files(self) -> None:
        files = count_files()
        if self.is_paused != (files > self._most_files):
            self.is_paused = not self.is_paused
            for listener in self._listeners:
                pause_listener(listener, is_paused=self.is_paused)


def _place(locator: Any) -> str:
    return str(locator).partition("/")[2].split("?")[0].split("#")[0]


def _port(locator: Any) -> int:
    return int(_place(locator).rpartition(":")[2])
