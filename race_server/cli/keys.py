"""`race keys`: what a session that is open to other machines needs."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

app = typer.Typer(help="Keys of a session that is open to other machines.", no_args_is_help=True)


@app.command()
def new(
    session: Annotated[str, typer.Argument(help="Name of the session that they are for.")],
    seats: Annotated[int, typer.Option(min=1, max=64, help="Seats; a driver each.")] = 8,
    spectators: Annotated[
        int, typer.Option(min=0, help="How many may watch at once, all with the same keys.")
    ] = 8,
    host: Annotated[
        list[str] | None,
        typer.Option(help="Name or address of the server as clients see it; may be repeated."),
    ] = None,
    port: Annotated[int, typer.Option(min=1, max=65535, help="Port of the server.")] = 7447,
    days: Annotated[float, typer.Option(min=0.01, help="Days until they expire.")] = 7.0,
    folder: Annotated[
        Path | None, typer.Option(help="New folder for them; by default keys-SESSION.")
    ] = None,
) -> None:
    """Make certificates and passwords for the server, each seat, spectators and the steward."""
    from race_server.net.auth.issue import Order, issue_keys

    target = folder or Path(f"keys-{session}")
    order = Order(session, seats, spectators, tuple(host or ()), port, days)
    handed = issue_keys(order, target)
    console = Console(soft_wrap=True, highlight=False)
    console.print(f"{target}: keys for {seats} seats, spectators and the steward of {session}")
    if not host:
        console.print(
            "They fit a server on this machine only; for others give its address with --host.",
            style="yellow",
        )
    console.print(f"serve:  race serve --open --keys {target} --session {session} --karts {seats}")
    console.print(
        f"drive:  race drive NAME --keys {handed[0].folder}   (connects to {handed[0].address})"
    )
    console.print(f"{target / 'README.md'} says what to hand to whom.")


@app.command()
def check(
    folder: Annotated[Path, typer.Argument(help="Folder of one person, or of the server.")],
) -> None:
    """Say whose keys these are, whether they can be read, and until when they are good."""
    from race_server.net.auth.keys import read_keys

    held = read_keys(folder)
    print(f"{folder}: {held.role} of session {held.session}, good until {held.expires}")
