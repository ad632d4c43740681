"""`race admin`: steward a session."""

import getpass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from race_server.cli.access import Connect, KeysFolder, SessionName, access
from race_server.core.bounds import LAST_SEAT
from race_server.errors import SeatError
from race_server.terminal import say

if TYPE_CHECKING:
    from race_server.live.client.steward import StewardClient
    from race_server.net.transport import ClientLink

app = typer.Typer(
    help="Steward a session: flags, penalties, seats, the clock. Requires the steward's keys; for "
    "a session without keys, run it on the server's machine, where `race serve` leaves a token.",
    no_args_is_help=True,
)

# A message has 16 bits for the number of a protest.
MOST_PROTESTS = 65_535
SeatNumber = Annotated[
    int, typer.Argument(min=0, max=LAST_SEAT, help="Number of the seat, from 0.")
]


@app.command()
def flag(
    colour: Annotated[str, typer.Argument(help="Flag: green, yellow or red.")],
    keys: KeysFolder = None,
    connect: Connect = "",
    session: SessionName = "",
) -> None:
    """Show a flag to all karts. After a red flag they stay stopped for three more seconds."""
    from race_server.core.messages import Flag

    if colour.upper() not in Flag.__members__:
        raise SeatError(f"flag {colour!r} is unknown; choose green, yellow or red")
    _decide("flag", keys, connect, session, value=float(Flag[colour.upper()]))


@app.command()
def pause(keys: KeysFolder = None, connect: Connect = "", session: SessionName = "") -> None:
    """Pause the race; drivers stay connected, karts keep their place and speed."""
    _decide("pause", keys, connect, session)


@app.command()
def resume(keys: KeysFolder = None, connect: Connect = "", session: SessionName = "") -> None:
    """Resume a paused race."""
    _decide("resume", keys, connect, session)


@app.command()
def penalty(
    seat: SeatNumber,
    seconds: Annotated[
        float, typer.Option(help="Seconds to add to the race time; -5 takes 5 of them back.")
    ] = 5.0,
    keys: KeysFolder = None,
    connect: Connect = "",
    session: SessionName = "",
) -> None:
    """Penalise a seat with seconds on its race time, or take some back."""
    _decide("penalty", keys, connect, session, seat=seat, value=seconds)


@app.command()
def protest(
    seat: Annotated[
        int, typer.Argument(min=0, max=LAST_SEAT, help="Seat of the team that protests.")
    ],
    against: Annotated[
        int, typer.Option(min=0, max=LAST_SEAT, help="Seat of the team that it is against.")
    ],
    why: Annotated[str, typer.Option(help="The reason, at most 120 characters.")],
    keys: KeysFolder = None,
    connect: Connect = "",
    session: SessionName = "",
) -> None:
    """Lodge a protest in an event: against the last result of a team, until its stage is over."""
    _decide("protest", keys, connect, session, seat=seat, against=against, note=why)


@app.command()
def uphold(
    number: Annotated[int, typer.Argument(min=1, max=MOST_PROTESTS, help="Number of the protest.")],
    seconds: Annotated[float, typer.Option(help="Seconds to add to the time.")] = 5.0,
    disqualify: Annotated[
        bool, typer.Option("--disqualify", help="Take the result away instead.")
    ] = False,
    keys: KeysFolder = None,
    connect: Connect = "",
    session: SessionName = "",
) -> None:
    """Uphold a protest with seconds on the time of the team that it is against."""
    if disqualify:
        _decide("disqualify", keys, connect, session, protest=number)
    else:
        _decide("uphold", keys, connect, session, protest=number, value=seconds)


@app.command()
def dismiss(
    number: Annotated[int, typer.Argument(min=1, max=MOST_PROTESTS, help="Number of the protest.")],
    keys: KeysFolder = None,
    connect: Connect = "",
    session: SessionName = "",
) -> None:
    """Dismiss a protest: or take back, until the review is over, what was decided on it."""
    _decide("dismiss", keys, connect, session, protest=number)


@app.command()
def remove(
    seat: SeatNumber,
    reason: Annotated[
        str,
        typer.Option(help="wrong-way, standing, ramming, dangerous, defect or other."),
    ],
    keys: KeysFolder = None,
    connect: Connect = "",
    session: SessionName = "",
) -> None:
    """Remove a kart from the race that is on, for a reason; its driver keeps the seat."""
    from race_server.core.messages import Fault

    name = reason.upper().replace("-", "_")
    if name not in Fault.__members__:
        known = ", ".join(fault.name.lower().replace("_", "-") for fault in Fault)
        raise SeatError(f"--reason {reason!r} is unknown; choose one of {known}")
    _decide("remove", keys, connect, session, seat=seat, value=float(Fault[name]))


@app.command()
def disqualify(
    seat: SeatNumber,
    why: Annotated[str, typer.Option(help="The reason, at most 120 characters.")],
    keys: KeysFolder = None,
    connect: Connect = "",
    session: SessionName = "",
) -> None:
    """Take the last result of a team in an event away, until its stage is over."""
    _decide("disqualify", keys, connect, session, seat=seat, note=why)


@app.command()
def kick(
    seat: SeatNumber, keys: KeysFolder = None, connect: Connect = "", session: SessionName = ""
) -> None:
    """Remove the driver of a seat from the race and close the seat until `race admin open`."""
    _decide("kick", keys, connect, session, seat=seat)


@app.command()
def close(
    seat: SeatNumber, keys: KeysFolder = None, connect: Connect = "", session: SessionName = ""
) -> None:
    """Close a seat to new drivers; its present driver keeps it."""
    _decide("close", keys, connect, session, seat=seat)


@app.command("open")
def open_seat(
    seat: SeatNumber, keys: KeysFolder = None, connect: Connect = "", session: SessionName = ""
) -> None:
    """Open a closed seat to drivers again."""
    _decide("open", keys, connect, session, seat=seat)


@app.command()
def park(
    seat: Annotated[
        int,
        typer.Argument(
            min=-1, max=LAST_SEAT, help="Number of the seat; without one, all that drive."
        ),
    ] = -1,
    slot: Annotated[
        int, typer.Option(min=-1, help="Number of the slot; -1: the one that the vehicle has.")
    ] = -1,
    keys: KeysFolder = None,
    connect: Connect = "",
    session: SessionName = "",
) -> None:
    """Have vehicles of a car park parked: the server's parking driver takes their wheels."""
    if seat < 0 <= slot:
        raise SeatError(f"--slot {slot} is for one vehicle: name its seat too")
    _decide("park", keys, connect, session, seat=seat, value=float(slot))


@app.command()
def restart(keys: KeysFolder = None, connect: Connect = "", session: SessionName = "") -> None:
    """Stop the race and start it again with the drivers that are connected."""
    _decide("restart", keys, connect, session)


@app.command("log")
def show_log(keys: KeysFolder = None, connect: Connect = "", session: SessionName = "") -> None:
    """List the decisions of stewards since the server started; its log has those of before."""
    steward, link = _steward(keys, connect, session)
    with link:
        for line in steward.log():
            say(line)


def _decide(
    act: str,
    keys: Path | None,
    connect: str,
    session: str,
    **what: int | float | str,
) -> None:
    if wrong := [value for value in what.values() if value != value]:
        raise SeatError(f"{wrong[0]} is no number of seconds")
    steward, link = _steward(keys, connect, session)
    with link:
        say(steward.decide(act, **what))


def _steward(keys: Path | None, connect: str, session: str) -> "tuple[StewardClient, ClientLink]":
    from race_server.live.client.steward import StewardClient
    from race_server.net.auth.token import read_token
    from race_server.net.transport import ClientLink

    given = access(keys, connect, session)
    given.check_steward()
    token = given.keys.token if given.keys else read_token(given.address, given.session)
    link = ClientLink(given.address, given.session, keys=given.keys)
    return StewardClient(link, token, getpass.getuser()), link
