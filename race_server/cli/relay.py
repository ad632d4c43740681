"""`race relay`: karts of two sites in one race."""

from pathlib import Path
from typing import Annotated

import typer

from race_server.cli.access import SESSION
from race_server.cli.document import AsJson, print_document
from race_server.cli.options import names_in
from race_server.core.bounds import LAST_SEAT, MOST_S
from race_server.errors import ScenarioError
from race_server.net.transport import DEFAULT_ADDRESS
from race_server.terminal import Console


def relay(
    here: Annotated[str, typer.Option(help="Address of the first server.")] = DEFAULT_ADDRESS,
    there: Annotated[str, typer.Option(help="Address of the second server (required).")] = "",
    bring: Annotated[
        str,
        typer.Option(
            help="Seats driven on the second server that also race on the first, such as 2,3."
        ),
    ] = "",
    send: Annotated[
        str,
        typer.Option(
            help="Seats driven on the first server that also race on the second, such as 0,1."
        ),
    ] = "",
    session: Annotated[
        str, typer.Option(help="Name of the session on the first server.")
    ] = SESSION,
    there_session: Annotated[
        str, typer.Option(help="Name of the session on the second server.")
    ] = SESSION,
    keys: Annotated[
        Path | None,
        typer.Option(
            help="Folder with `spectator` and `seat-N` keys of the first server, if it has keys."
        ),
    ] = None,
    there_keys: Annotated[Path | None, typer.Option(help="The same for the second server.")] = None,
    patience: Annotated[
        float, typer.Option(min=0.0, max=MOST_S, help="Seconds to wait for both servers.")
    ] = 60.0,
    as_json: AsJson = False,
) -> None:
    """Let karts of two sites race against each other for one race.

    A kart has the same seat number on both servers; on the server where it is not driven its seat
    must be free. Both servers run the same course.
    """
    from race_server.live.client.bridge import Site
    from race_server.live.client.bridge import relay as relay_race

    if not there:
        raise ScenarioError("--there is missing: give the address of the second server")
    first = Site(here, session, _seats("--bring", bring), keys)
    second = Site(there, there_session, _seats("--send", send), there_keys)
    console = Console(stderr=True)
    console.print(f"waits for {here} and {there}, {patience:g} s at most")
    document = relay_race(
        first,
        second,
        timeout_s=patience,
        on_seated=lambda: console.print("all relayed karts have their seats"),
    )
    if as_json:
        print_document(document)
        return
    for site, guests in document.items():
        for guest in guests:
            console.print(
                f"{site}, seat {guest['seat']}: {guest['poses']} poses, "
                f"position error {guest['miss_median_m']} m (median), "
                f"{guest['miss_p99_m']} m (99th percentile)"
            )


def _seats(option: str, words: str) -> tuple[int, ...]:
    """Return the seats of a comma-separated list.

    Raises:
        ScenarioError: one is no number of a seat, or stands there twice.
    """
    seats = names_in(words)
    for seat in seats:
        if not seat.isdecimal() or not seat.isascii() or len(seat) > 3 or int(seat) > LAST_SEAT:
            raise ScenarioError(
                f"{option} {words!r}: {seat!r} is no seat; write numbers from 0 to {LAST_SEAT} "
                "with commas, such as 2,3"
            )
    numbers = tuple(map(int, seats))
    for number in numbers:
        if numbers.count(number) > 1:
            raise ScenarioError(f"{option} {words!r}: seat {number} is there twice; name it once")
    return numbers
