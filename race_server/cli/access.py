"""How a command connects to a session: address, session name, keys."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import typer

from race_server.errors import KeysError
from race_server.net.auth.keys import ClientKeys, read_client_keys
from race_server.net.transport import DEFAULT_ADDRESS

SESSION = "race"
Connect = Annotated[
    str,
    typer.Option(
        "--connect",
        help=f"Address of the server. Default: the one in the keys, else {DEFAULT_ADDRESS}.",
    ),
]
SessionName = Annotated[
    str,
    typer.Option(
        "--session", help=f"Name of the session. Default: the one in the keys, else {SESSION}."
    ),
]
KeysFolder = Annotated[
    Path | None,
    typer.Option("--keys", help="Folder of keys from the organiser, for a session with keys."),
]


@dataclass(frozen=True)
class Access:
    """How a command connects to a session."""

    keys: ClientKeys | None
    address: str
    session: str

    def check_steward(self) -> None:
        """Check that a steward may connect so: without keys anyone on this machine is one.

        Raises:
            KeysError: the keys are another role's.
        """
        if self.keys is not None and not self.keys.token:
            raise KeysError(
                f"{self.keys.folder} holds the keys of {self.keys.role}, not those of the steward"
            )

    def seat(self, wanted: int) -> int:
        """Return the seat to ask for.

        Raises:
            KeysError: the keys belong to another seat, or to no driver.
        """
        if self.keys is None:
            return wanted
        if self.keys.seat < 0 or wanted not in {-1, self.keys.seat}:
            raise KeysError(
                f"the keys in {self.keys.folder} are those of {self.keys.role}: they cannot drive "
                + (f"seat {wanted}" if wanted >= 0 else "a kart")
            )
        return self.keys.seat


def access(folder: Path | None, connect: str, session: str) -> Access:
    """Return how to connect, from the options of a command.

    Raises:
        KeysError: the keys cannot be used, or are those of another session.
    """
    if folder is None:
        return Access(None, connect or DEFAULT_ADDRESS, session or SESSION)
    keys = read_client_keys(folder, session)
    return Access(keys, connect or keys.address, keys.session)
