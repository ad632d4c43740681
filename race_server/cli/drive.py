"""`race drive` and `race watch`: one driver, or one spectator, of a race that is served."""

import os
import time
from contextlib import ExitStack
from functools import partial
from typing import TYPE_CHECKING, Annotated

import typer
from rich.live import Live
from rich.status import Status as Spinner
from rich.text import Text

from race_server.cli.access import Connect, KeysFolder, SessionName, access
from race_server.cli.document import AsJson, print_document
from race_server.core.bounds import LAST_SEAT, MOST_S
from race_server.errors import RaceError
from race_server.terminal import Console, say

if TYPE_CHECKING:
    from race_server.live.client.link_stats import LinkStats

# A driver that has not answered for this long ends; its kart is out long before [s].
HUNG_S = 30.0


def drive(
    name: Annotated[str, typer.Argument(help="Name of an installed driver.")],
    connect: Connect = "",
    session: SessionName = "",
    seat: Annotated[
        int,
        typer.Option(
            min=-1,
            max=LAST_SEAT,
            help="Number of the seat to take; -1: any, or the one in the keys.",
        ),
    ] = -1,
    keys: KeysFolder = None,
    as_name: Annotated[
        str, typer.Option("--name", help="Name in the standings. Default: that of the driver.")
    ] = "",
    patience: Annotated[
        float, typer.Option(min=0.0, max=MOST_S, help="Seconds to wait for the server.")
    ] = 20.0,
    raw: Annotated[
        bool, typer.Option("--raw", help="Do not compensate for network latency.")
    ] = False,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print link statistics as one JSON document.")
    ] = False,
) -> None:
    """Take a seat and drive one race."""
    # Set before any kernel is imported: 20 decisions a second need no compiler.
    os.environ["RACE_SERVER_INTERPRET"] = "1"
    from race_server.core.driver import driver_named
    from race_server.live.client.driver import checked_name
    from race_server.live.client.driver import run_driver as drive_race
    from race_server.live.client.link_stats import LinkStats
    from race_server.live.watchdog import Watchdog

    given, watchdog = access(keys, connect, session), Watchdog(HUNG_S)
    link_stats, console = LinkStats(), Console(stderr=True)
    drive_now = partial(
        drive_race,
        driver_named(name),
        checked_name(as_name) if as_name else name,
        address=given.address,
        session=given.session,
        wanted=given.seat(seat),
        timeout_s=patience,
        keys=given.keys,
        raw=raw,
        link_stats=link_stats if as_json or console.is_terminal else None,
        on_turn=watchdog.turn,
    )
    if console.is_terminal:
        with console.status(f"{name}: waiting for the race") as status:
            taken = drive_now(on_observation=partial(_show_reception, status, name)).seat
        console.print(f"{name}, seat {taken}: {link_stats.outcome or 'the race is over'}")
    else:
        taken = drive_now().seat
    watchdog.rest()
    if as_json:
        print_document({"driver": name, "seat": taken, **link_stats.as_json()})


def _show_reception(status: Spinner, name: str, link_stats: "LinkStats") -> None:
    """Show a few times a second how old the driver's observations are."""
    if link_stats.received % 5 == 1:
        status.update(Text(f"{name} {link_stats}"))


def watch(
    connect: Connect = "",
    session: SessionName = "",
    keys: KeysFolder = None,
    foxglove: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="Serve the race to Foxglove on this port; 0: any free port.",
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Show the live leaderboard of a race until it ends; with --json, print the standings once."""
    from dataclasses import asdict

    from race_server.competition.launch import board_of
    from race_server.live.client.foxglove import FoxgloveServer
    from race_server.live.client.spectator import Spectator
    from race_server.live.client.timing import ClientTiming
    from race_server.net.transport import ClientLink

    given, timeout_s = access(keys, connect, session), ClientTiming().spectator_timeout_s
    with ClientLink(given.address, given.session, keys=given.keys) as link:
        spectator = Spectator(link)
        if as_json:
            print_document(asdict(spectator.standings) if spectator.standings else {})
            return
        _, items = spectator.rules()
        with ExitStack() as stack:
            if foxglove is not None:
                view = stack.enter_context(FoxgloveServer(link, spectator, given.session, foxglove))
                say(f"Foxglove: open {view.address} as a Foxglove WebSocket")
            live = stack.enter_context(Live(console=Console(), refresh_per_second=8))
            while (final := spectator.final) is None:
                live.update(board_of(spectator, given.session, items))
                time.sleep(0.12)
                if spectator.silence_s() > timeout_s and not spectator.refresh():
                    silent = spectator.silence_s()
                    raise RaceError(
                        f"the server at {given.address} has stopped: no message for {silent:.0f} s"
                    )
            live.update(board_of(spectator, given.session, items, final))
