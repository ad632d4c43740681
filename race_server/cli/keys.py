"""`race keys`: certificates and passwords of a session that other machines may join."""

from pathlib import Path
from typing import Annotated

import typer

from race_server.terminal import Console, say

# A hundred years: a certificate has no year after 9999.
MOST_DAYS = 36_500.0
MOST_SPECTATORS = 10_000

app = typer.Typer(
    help="Make and check keys for a session that other machines may join.", no_args_is_help=True
)


@app.command()
def new(
    session: Annotated[str, typer.Argument(help="Name of the session.")],
    seats: Annotated[
        int, typer.Option(min=1, max=64, help="Number of seats; one driver each.")
    ] = 8,
    spectators: Annotated[
        int,
        typer.Option(
            min=0,
            max=MOST_SPECTATORS,
            help="Spectators that may watch at once; all share one set of keys.",
        ),
    ] = 8,
    host: Annotated[
        list[str] | None,
        typer.Option(
            help="Host name or address of the server as clients see it; may be repeated. Default: "
            "this machine only."
        ),
    ] = None,
    port: Annotated[
        int, typer.Option(min=1, max=65535, help="Port on which the server listens.")
    ] = 7447,
    days: Annotated[
        float, typer.Option(min=0.01, max=MOST_DAYS, help="Days until the keys expire.")
    ] = 7.0,
    folder: Annotated[
        Path | None, typer.Option(help="New folder for the keys. Default: keys-SESSION.")
    ] = None,
) -> None:
    """Make certificates and passwords for the server, each seat, the spectators and the steward."""
    from race_server.net.auth.issue import Order, issue_keys

    target = folder or Path(f"keys-{session}")
    order = Order(session, seats, spectators, tuple(host or ()), port, days)
    handed = issue_keys(order, target)
    console = Console(soft_wrap=True, highlight=False)
    console.print(f"{target}: keys for {seats} seats, spectators and the steward of {session}")
    if not host:
        console.print(
            "They fit a server on this machine only; for another one give its address with --host.",
            style="yellow",
        )
    console.print(f"serve:  race serve --open --keys {target} --session {session} --karts {seats}")
    console.print(
        f"drive:  race drive NAME --keys {handed[0].folder}   (connects to {handed[0].address})"
    )
    console.print(f"{target / 'README.md'} lists which folder goes to whom.")


@app.command()
def revoke(
    folder: Annotated[Path, typer.Argument(help="Folder of the session's keys.")],
    role: Annotated[str, typer.Argument(help="Whose keys: seat-N, spectator or steward.")],
) -> None:
    """Revoke the keys of a role; a server that runs with them closes its links within a second."""
    from race_server.net.auth.keys import REVOKED, revoke_keys

    held = revoke_keys(folder, role)
    say(f"{held.folder / REVOKED}: the keys of {role} of session {held.session} are revoked")
    say(f"for new ones make a new folder: race keys new {held.session} --folder FOLDER")


@app.command()
def check(
    folder: Annotated[
        Path, typer.Argument(help="Folder of one role: server, seat-N, spectator or steward.")
    ],
) -> None:
    """Print the role and expiry of keys, and fail if they cannot be used."""
    from race_server.net.auth.keys import read_keys

    held = read_keys(folder)
    say(f"{folder}: {held.role} of session {held.session}, valid until {held.expires}")
