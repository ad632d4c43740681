"""`race admin`: what a steward may do to a session."""

import getpass
from pathlib import Path
from typing import Annotated

import typer

from race_server.cli.access import Connect, KeysFolder, SessionName, access
from race_server.errors import KeysError, SeatError
from race_server.live.client.steward import StewardClient
from race_server.net.transport import ClientLink

app = typer.Typer(
    help="Steward a session: flags, penalties, seats, the clock. Needs the steward's keys, or on "
    "the machine that serves without keys the token that `race serve` left there.",
    no_args_is_help=True,
)

SeatNumber = Annotated[int, typer.Argument(min=0, help="Number of the seat.")]


@app.command()
def flag(
    colour: Annotated[str, typer.Argument(help="green, yellow or red.")],
    keys: KeysFolder = None,
    connect: Connect = "",
    session: SessionName = "",
) -> None:
    """Show a flag to all karts. After red they stand for three more seconds."""
    from race_server.core.messages import Flag

    if colour.upper() not in Flag.__members__:
        raise SeatError(f"flag {colour!r} is unknown; choose green, yellow or red")
    _decide("flag", keys, connect, session, value=float(Flag[colour.upper()]))


@app.command()
def pause(keys: KeysFolder = None, connect: Connect = "", session: SessionName = "") -> None:
    """Stop the clock; drivers keep their links, karts stand where they are."""
    _decide("pause", keys, connect, session)


@app.command()
def resume(keys: KeysFolder = None, connect: Connect = "", session: SessionName = "") -> None:
    """Let the clock go on."""
    _decide("resume", keys, connect, session)


@app.command()
def penalty(
    seat: SeatNumber,
    seconds: Annotated[float, typer.Option(help="Added to the race time.")] = 5.0,
    keys: KeysFolder = None,
    connect: Connect = "",
    session: SessionName = "",
) -> None:
    """Add seconds to the race time of a seat."""
    _decide("penalty", keys, connect, session, seat=seat, value=seconds)


@app.command()
def kick(
    seat: SeatNumber, keys: KeysFolder = None, connect: Connect = "", session: SessionName = ""
) -> None:
    """Send a driver away: its kart is out, its seat is shut until `open`."""
    _decide("kick", keys, connect, session, seat=seat)


@app.command()
def close(
    seat: SeatNumber, keys: KeysFolder = None, connect: Connect = "", session: SessionName = ""
) -> None:
    """Let nobody take a seat; who has it keeps it."""
    _decide("close", keys, connect, session, seat=seat)


@app.command("open")
def open_seat(
    seat: SeatNumber, keys: KeysFolder = None, connect: Connect = "", session: SessionName = ""
) -> None:
    """Let a seat be taken again."""
    _decide("open", keys, connect, session, seat=seat)


@app.command()
def restart(keys: KeysFolder = None, connect: Connect = "", session: SessionName = "") -> None:
    """Break the race off and start it anew with the drivers who are there."""
    _decide("restart", keys, connect, session)


@app.command("log")
def show_log(keys: KeysFolder = None, connect: Connect = "", session: SessionName = "") -> None:
    """Show what was decided, when and by whom."""
    marshal, link = _marshal(keys, connect, session)
    with link:
        for line in marshal.log():
            print(line)


def _decide(
    act: str,
    keys: Path | None,
    connect: str,
    session: str,
    *,
    seat: int = -1,
    value: float = 0.0,
) -> None:
    marshal, link = _marshal(keys, connect, session)
    with link:
        print(marshal.decide(act, seat=seat, value=value))


def _marshal(keys: Path | None, connect: str, session: str) -> tuple[StewardClient, ClientLink]:
    from race_server.net.auth.token import read_token

    given = access(keys, connect, session)
    if given.keys is not None and not given.keys.token:
        raise KeysError(f"{keys} holds the keys of {given.keys.role}, not those of the steward")
    token = given.keys.token if given.keys else read_token(given.address, given.session)
    link = ClientLink(given.address, given.session, keys=given.keys)
    return StewardClient(link, token, getpass.getuser()), link
