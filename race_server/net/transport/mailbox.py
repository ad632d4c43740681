"""A mailbox for the newest message."""

import threading


class Mailbox:
    """Holds the newest message until it is taken."""

    def __init__(self) -> None:
        self._newest: bytes | None = None
        self._condition = threading.Condition()

    def put(self, data: bytes) -> None:
        """Store a message; it replaces an older one."""
        with self._condition:
            self._newest = data
            self._condition.notify()

    def take(self, timeout_s: float) -> bytes | None:
        """Return the newest message, or None if none arrives within `timeout_s`."""
        with self._condition:
            if self._newest is None:
                self._condition.wait(timeout_s)
            data, self._newest = self._newest, None
            return data
