"""A place for one message: the newest."""

import threading


class Mailbox:
    """Holds the newest message until it is taken."""

    def __init__(self) -> None:
        self._newest: bytes | None = None
        self._condition = threading.Condition()

    def put(self, data: bytes) -> None:
        """Store a message; an older one that was not taken is dropped."""
        with self._condition:
            self._newest = data
            self._condition.notify()

    def take(self, timeout_s: float) -> bytes | None:
        """Return the newest message, or None if none comes within `timeout_s`."""
        with self._condition:
            if self._newest is None:
                self._condition.wait(timeout_s)
            data, self._newest = self._newest, None
            return data
