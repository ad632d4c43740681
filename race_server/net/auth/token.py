"""The steward's token of a server without keys, in a file that only its user can read."""

import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from race_server.errors import KeysError
from race_server.net.auth.keys import write_private


def token_path(address: str, session: str) -> Path:
    """Return the path of the token of a session on this machine."""
    base = os.environ.get("XDG_RUNTIME_DIR") or os.environ.get("XDG_DATA_HOME")
    home = Path(base) if base else Path.home() / ".local" / "share"
    place = re.sub(r"[^A-Za-z0-9]+", "-", address)
    return home / "race-server" / "stewards" / f"{session}-{place}.token"


@contextmanager
def local_token(address: str, session: str) -> Iterator[str]:
    """Yield a new token, whose file exists until the block ends.

    Raises:
        KeysError: the file cannot be written.
    """
    path, token = token_path(address, session), secrets.token_hex(16)
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        write_private(path, token)
    except OSError as error:
        raise KeysError(
            f"{path}: the steward's token cannot be written ({error.strerror})"
        ) from error
    try:
        yield token
    finally:
        path.unlink(missing_ok=True)


def read_token(address: str, session: str) -> str:
    """Return the token of a session that this user serves on this machine.

    Raises:
        KeysError: there is none.
    """
    path = token_path(address, session)
    try:
        return path.read_text().strip()
    except OSError as error:
        raise KeysError(
            f"{path}: no token of a steward ({error.strerror}). It is there while `race serve` "
            f"runs on this machine as the same user, listens on {address} and serves "
            f"{session!r}; elsewhere pass the steward's keys with --keys"
        ) from error
