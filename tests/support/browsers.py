"""A browser for tests: authenticates with a gateway, and keeps what it receives."""

import json
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any, Self

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

Words = dict[str, Any]

# The first words of a browser in each role.
WATCH: Words = {"role": "spectate", "rate": 60}
DRIVE: Words = {"role": "drive", "token": "drive one", "seat": 1, "name": "Ada"}
STEWARD: Words = {"role": "steward", "token": "steward one", "name": "Eve"}


class Browser:
    """One WebSocket to a gateway."""

    def __init__(self, base: str, hello: Words | str | bytes | None = None, **named: Any) -> None:
        """Connect to ``http://host:port/`` and send `hello`; None sends nothing."""
        named.setdefault("subprotocols", ["race.1"])
        address = base.replace("http", "ws", 1) + "ws"
        self._life = ExitStack()
        # Everything is read as it comes: nothing waits in the network.
        self.socket = self._life.enter_context(
            connect(address, compression=None, proxy=None, max_queue=None, **named)
        )
        self.words: list[Words] = []
        self.frames: list[bytes] = []
        if hello is not None:
            self.send(hello)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._life.close()

    def send(self, message: Words | str | bytes) -> None:
        """Send a dictionary as JSON, and all else as it is; nothing where the socket is closed."""
        with suppress(ConnectionClosed):
            self.socket.send(json.dumps(message) if isinstance(message, dict) else message)

    def receive(self, timeout_s: float = 5.0) -> Words | bytes | None:
        """Return the next message, None where none arrives or the socket is closed."""
        try:
            data = self.socket.recv(timeout=timeout_s)
        except (TimeoutError, ConnectionClosed):
            return None
        if isinstance(data, str):
            self.words.append(json.loads(data))
            return self.words[-1]
        self.frames.append(data)
        return data

    def until(self, is_it: Callable[[Any], object], timeout_s: float = 10.0) -> Any:
        """Return the first message from now on for which a condition holds."""
        deadline = time.monotonic() + timeout_s
        while (left := deadline - time.monotonic()) > 0.0:
            received = self.receive(left)
            if received is None:
                break
            if is_it(received):
                return received
        raise AssertionError(f"not received; the last texts were {self.words[-3:]}")

    def word(self, kind: str, timeout_s: float = 10.0) -> Words:
        """Return the next text message of a type."""
        found: Words = self.until(
            lambda received: isinstance(received, dict) and received["type"] == kind, timeout_s
        )
        return found

    def frame(self, identifier: bytes, timeout_s: float = 10.0) -> bytes:
        """Return the next bytes with an identifier."""
        found: bytes = self.until(
            lambda received: isinstance(received, bytes) and received[4:8] == identifier, timeout_s
        )
        return found

    def refusal(self) -> tuple[str, int | None]:
        """Return the code of its refusal, and the code with which its socket closes."""
        code: str = self.word("refused")["code"]
        while self.receive(2.0) is not None:
            pass
        return code, self.socket.close_code
