"""A zenoh session with a lifetime."""

import atexit
from typing import Any, Self

import zenoh

from race_server.net.auth.settings import as_json

DEFAULT_ADDRESS = "tcp/127.0.0.1:7447"


def open_session(settings: dict[str, Any]) -> zenoh.Session:
    """Return a zenoh session.

    Raises:
        ZError: it cannot be opened.
    """
    config = zenoh.Config()
    for key, value in as_json(settings):
        config.insert_json5(key, value)
    return zenoh.open(config)


class Link:
    """One end of a connection; a context manager."""

    def __init__(self, session: zenoh.Session) -> None:
        self._session = session
        self._is_open = True
        atexit.register(self.close)

    def close(self) -> None:
        """Close the session; a second call does nothing."""
        if self._is_open:
            self._is_open = False
            atexit.unregister(self.close)
            self._session.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
