"""`race relay`: karts of two halls in one race."""

from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from race_server.cli.access import SESSION
from race_server.cli.document import AsJson, print_document
from race_server.errors import ScenarioError
from race_server.net.transport import DEFAULT_ADDRESS


def relay(
    here: Annotated[str, typer.Option(help="Address of the first hall.")] = DEFAULT_ADDRESS,
    there: Annotated[str, typer.Option(help="Address of the second hall.")] = "",
    bring: Annotated[
        str, typer.Option(help="Seats whose karts drive there and are to race here too: 2,3.")
    ] = "",
    send: Annotated[
        str, typer.Option(help="Seats whose karts drive here and are to race there too: 0,1.")
    ] = "",
    session: Annotated[str, typer.Option(help="Name of the session here.")] = SESSION,
    there_session: Annotated[str, typer.Option(help="Name of the session there.")] = SESSION,
    keys: Annotated[
        Path | None,
        typer.Option(help="Folder with `spectator` and `seat-N` of this hall, where it has keys."),
    ] = None,
    there_keys: Annotated[Path | None, typer.Option(help="The same of the other hall.")] = None,
    patience: Annotated[float, typer.Option(help="Seconds to wait for the halls.")] = 60.0,
    as_json: AsJson = False,
) -> None:
    """Let karts of two halls race against each other for one race.

    A seat has the same number in both halls; in the hall where its kart does not drive it must be
    free. Both halls serve the same course.
    """
    from race_server.live.client.bridge import Site
    from race_server.live.client.bridge import relay as relay_race

    if not there:
        raise ScenarioError("--there is missing: give the address of the second hall")
    first = Site(here, session, _seats(bring), keys)
    second = Site(there, there_session, _seats(send), there_keys)
    console = Console(stderr=True)
    document = relay_race(
        first,
        second,
        timeout_s=patience,
        on_seated=lambda: console.print("all guests have their seats"),
    )
    if as_json:
        print_document(document)
        return
    for hall, guests in document.items():
        for guest in guests:
            console.print(
                f"{hall}, seat {guest['seat']}: {guest['poses']} poses, "
                f"{guest['miss_median_m']} m from its true place (median), "
                f"{guest['miss_p99_m']} m at most in 99 of 100"
            )


def _seats(words: str) -> tuple[int, ...]:
    try:
        return tuple(int(word) for word in words.split(",") if word.strip())
    except ValueError as error:
        raise ScenarioError(f"seats {words!r}: write numbers with commas, such as 2,3") from error
