"""Folders of keys: of the server, and of each person.

A folder holds ``keys.json`` and, for encrypted links, ``ca.pem``, ``certificate.pem`` and
``key.pem``. `race keys new` writes them; other tools may write the same files.
"""

import json
import ssl
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, TypeVar

from race_server.errors import KeysError
from race_server.net.auth.access import common_name
from race_server.plain_data import made_of

CA, CERTIFICATE, KEY = "ca.pem", "certificate.pem", "key.pem"
PASSWORDS, ABOUT, REVOKED = "passwords.txt", "keys.json", "revoked.txt"

Held = TypeVar("Held", "ServerKeys", "ClientKeys")


@dataclass(frozen=True)
class ClientKeys:
    """The keys of one person."""

    folder: Path
    session: str
    role: str  # seat-3, spectator or steward
    user: str
    password: str
    address: str  # of the server
    expires: str  # ISO 8601, of the certificate
    seat: int = -1
    token: str = ""  # the steward's


@dataclass(frozen=True)
class ServerKeys:
    """The keys of the server."""

    folder: Path
    session: str
    seats: int
    spectators: int
    expires: str
    token: str  # the steward's
    role: str = "server"


def write_keys(held: ServerKeys | ClientKeys) -> None:
    """Write ``keys.json`` of a folder, readable by its owner only."""
    row = {name: value for name, value in asdict(held).items() if name != "folder"}
    write_private(held.folder / ABOUT, json.dumps(row, indent=2) + "\n")


def write_private(path: Path, text: str | bytes) -> None:
    """Write a file that is readable by its owner only from the start."""
    path.unlink(missing_ok=True)
    path.touch(mode=0o600)
    path.write_bytes(text.encode() if isinstance(text, str) else text)


def read_server_keys(folder: Path, session: str, seats: int) -> ServerKeys:
    """Return the keys of a server from the folder of `race keys new`, or from its `server`.

    session: "" for that of the keys.

    Raises:
        KeysError: unreadable, expired, or made for another session or fewer seats.
    """
    inner = folder / "server"
    held = _read(inner if inner.is_dir() else folder, ServerKeys)
    if session and held.session != session:
        raise KeysError(
            f"the keys in {folder} are for session {held.session!r}, not {session!r}: "
            f"serve with --session {held.session}, or make new ones with `race keys new {session}`"
        )
    if held.seats < seats:
        raise KeysError(
            f"the keys in {folder} are for {held.seats} seats, the race has {seats}: "
            f"serve with --karts {held.seats}, or make more with "
            f"`race keys new {held.session} --seats {seats}`"
        )
    return held


def read_client_keys(folder: Path, session: str = "") -> ClientKeys:
    """Return the keys of one person.

    Raises:
        KeysError: unreadable, expired, or made for another session.
    """
    held = _read(folder, ClientKeys)
    if session and held.session != session:
        raise KeysError(
            f"the keys in {folder} are for session {held.session!r}, not {session!r}: "
            "leave --session out, or ask the organiser for the right keys"
        )
    return held


def read_keys(folder: Path) -> ServerKeys | ClientKeys:
    """Return keys of either kind.

    Raises:
        KeysError: unreadable or expired.
    """
    is_server = (folder / "server").is_dir() or (folder / PASSWORDS).exists()
    if not is_server:
        return _read(folder, ClientKeys)
    inner = folder / "server"
    return _read(inner if inner.is_dir() else folder, ServerKeys)


def revoke_keys(folder: Path, role: str) -> ServerKeys:
    """Add a role to the revoked ones of a session and return the session's keys.

    folder: that of `race keys new`, or its `server`. A server that runs obeys within a second.

    Raises:
        KeysError: the keys of the server cannot be read or written, or there is no such role.
    """
    held = read_keys(folder)
    if not isinstance(held, ServerKeys):
        raise KeysError(f"{folder} holds the keys of {held.role}: pass the folder of the session")
    name = common_name(held.session, role)
    try:
        users = (held.folder / PASSWORDS).read_text().split()
        known = [user.split(":")[0] for user in users]
        if name not in known:
            raise KeysError(
                f"{folder} has no keys of {role!r}; choose one of "
                + ", ".join(user.removeprefix(f"{held.session}-") for user in known)
            )
        revoked = read_revoked(held.folder) | {name}
        fresh = held.folder / f"{REVOKED}.new"
        write_private(fresh, "".join(f"{name}\n" for name in sorted(revoked)))
        fresh.replace(held.folder / REVOKED)  # a server reads the old file or the new one
    except OSError as error:
        raise KeysError(f"{held.folder}: cannot be written ({error.strerror})") from error
    return held


def read_revoked(folder: Path) -> frozenset[str]:
    """Return the common names whose keys are revoked. folder: of the server.

    Raises:
        KeysError: the file is there and cannot be read.
    """
    path = folder / REVOKED
    try:
        return frozenset(path.read_text().split())
    except FileNotFoundError:
        return frozenset()
    except (OSError, UnicodeDecodeError) as error:
        raise KeysError(f"{path}: cannot be read ({error})") from error


def _read(folder: Path, kind: type[Held]) -> Held:
    path = folder / ABOUT
    try:
        row: Any = json.loads(path.read_text())
        held = made_of(kind, {**row, "folder": folder.resolve()} if isinstance(row, dict) else row)
        # UTC where no zone is named.
        expires = datetime.fromisoformat(held.expires)
        expires = expires if expires.tzinfo else expires.replace(tzinfo=UTC)
    except OSError as error:
        raise KeysError(f"{path}: cannot be read ({error.strerror}); {_way_out(folder)}") from error
    except (ValueError, RecursionError) as error:
        raise KeysError(
            f"{path} is damaged, or does not hold {_NAMES[kind]} ({error}); copy it again, or make "
            "new keys with `race keys new`"
        ) from error
    if expires < datetime.now(UTC):
        raise KeysError(
            f"the keys in {folder} expired on {expires:%Y-%m-%d %H:%M} UTC: "
            f"make new ones with `race keys new {held.session}`"
        )
    if (folder / CERTIFICATE).exists():
        _check_certificate(folder)
    return held


def _way_out(folder: Path) -> str:
    """Return what to pass in place of a folder without keys."""
    for words, place in (("one in it", folder), ("one beside it", folder.parent)):
        if roles := sorted(each.parent.name for each in place.glob(f"*/{ABOUT}")):
            return f"pass {words}: {', '.join(roles)}"
    return "pass a folder of `race keys new`"


def _check_certificate(folder: Path) -> None:
    """Raise KeysError unless certificate, its key and the authority are readable and match."""
    try:
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_CLIENT)
        context.load_verify_locations(folder / CA)
        context.load_cert_chain(folder / CERTIFICATE, folder / KEY)
    except OSError as error:  # ssl.SSLError is one
        raise KeysError(
            f"the certificate in {folder} cannot be used: {CA}, {CERTIFICATE} and {KEY} are "
            f"missing, damaged or do not belong together ({error.strerror or error})"
        ) from error


_NAMES = {ServerKeys: "keys of a server", ClientKeys: "keys of a driver, spectator or steward"}
