"""A browser for tests: says hello to a gateway, and keeps what it is told."""

import json
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from typing import Any, Self

from websockets.exceptions import ConnectionClosed
from websockets.sync.client import connect

Words = dict[str, Any]


class Browser:
    """One WebSocket to a gateway."""

    def __init__(self, base: str, hello: Words | str | bytes | None = None, **named: Any) -> None:
        """Connect to ``http://host:port/`` and say hello; None says nothing."""
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
        """Send words as JSON, and all else as it is; who was let go already says nothing."""
        with suppress(ConnectionClosed):
            self.socket.send(json.dumps(message) if isinstance(message, dict) else message)

    def hear(self, timeout_s: float = 5.0) -> Words | bytes | None:
        """Return the next message, None where none comes or the socket is closed."""
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
        """Return the first message from now on of which something is true."""
        deadline = time.monotonic() + timeout_s
        while (left := deadline - time.monotonic()) > 0.0:
            heard = self.hear(left)
            if heard is None:
                break
            if is_it(heard):
                return heard
        raise AssertionError(f"not heard; the last words were {self.words[-3:]}")

    def word(self, kind: str, timeout_s: float = 10.0) -> Words:
        """Return the next words of a type."""
        found: Words = self.until(
            lambda heard: isinstance(heard, dict) and heard["type"] == kind, timeout_s
        )
        return found

    def frame(self, identifier: bytes, timeout_s: float = 10.0) -> bytes:
        """Return the next bytes with an identifier."""
        found: bytes = self.until(
            lambda heard: isinstance(heard, bytes) and heard[4:8] == identifier, timeout_s
        )
        return found

    def refusal(self) -> tuple[str, int | None]:
        """Return the word by which it is refused, and the code with which its socket closes."""
        code: str = self.word("refused")["code"]
        while self.hear(2.0) is not None:
            pass
        return code, self.socket.close_code
