"""The options of a race, which `race serve` and `race start` share, and those of a server."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import typer

from race_server.cli.options import MOST_LAPS, Results, Track
from race_server.core.bounds import MOST_KARTS, MOST_ROUNDS, MOST_S
from race_server.core.seeds import MOST_SEED
from race_server.errors import ScenarioError
from race_server.net.transport import DEFAULT_ADDRESS

# Encrypted, to all networks of this machine.
OPEN_ADDRESS = "tls/0.0.0.0:7447"

Switch = Literal["on", "off"]
# As in `live/server`, which imports the compiler.
VALET = "valet"
PACES = ("real", "lockstep")


# The course of a race that names none.
TRACK = "covapsy-train-2023"


@dataclass(frozen=True)
class RaceOptions:
    """Which race is driven, and what is kept of it."""

    track: Track = TRACK
    lot: Annotated[
        str,
        typer.Option(
            help="Park in place of racing: a name from `race lot list`, or a .toml file. "
            "Default: none."
        ),
    ] = ""
    level: Annotated[
        str, typer.Option(help="With --lot: how well to park. Default: as the car park says.")
    ] = ""
    limit: Annotated[
        float,
        typer.Option(
            min=0.0, max=MOST_S, help="With --lot: seconds to park in; 0: as the car park says."
        ),
    ] = 0.0
    vehicle: Annotated[
        str,
        typer.Option(
            help="Vehicle: tt02, tt02-drift, kart-13, kart-30, kart-60, car; an unknown name lists "
            "all. Default: tt02, with --lot the one that the car park is made for."
        ),
    ] = ""
    format: Annotated[
        str,
        typer.Option(
            help="Serve an event in place of single races: time-trial, 2023, 2025, or a .toml "
            "file. It goes on where it was when the server is started again."
        ),
    ] = ""
    tracks: Annotated[
        str,
        typer.Option(
            help="With --format: comma-separated courses for tracks A, B and C. Default: --track "
            "for a format with one track."
        ),
    ] = ""
    attempts: Annotated[
        int,
        typer.Option(
            min=0,
            max=MOST_ROUNDS,
            help="With --format time-trial: attempts of each driver; 0: as it says.",
        ),
    ] = 0
    start: Annotated[
        str,
        typer.Option(
            help="With --format time-trial: flying, with a lap before those that are timed, or "
            "standing. Default: flying."
        ),
    ] = ""
    attempt_limit: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=MOST_S,
            help="With --format time-trial: seconds for an attempt, 1 or more; 0: as it says.",
        ),
    ] = 0.0
    cool_down: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=MOST_S,
            help="With --format: seconds after an attempt or race before the next one begins.",
        ),
    ] = 0.0
    call_limit: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=MOST_S,
            help="With --format: seconds to get ready; a driver that is not there does not start.",
        ),
    ] = 60.0
    karts: Annotated[int, typer.Option(min=1, max=MOST_KARTS, help="Number of seats.")] = 8
    laps: Annotated[int, typer.Option(min=1, max=MOST_LAPS, help="Laps to the finish.")] = 3
    seed: Annotated[
        int, typer.Option(min=0, max=MOST_SEED, help="Seed of every random draw in the race.")
    ] = 1
    pace: Annotated[
        str,
        typer.Option(help="real: 60 ticks a second. lockstep: wait for every driver."),
    ] = "real"
    items: Annotated[Switch, typer.Option(help="Place item boxes on the course.")] = "on"
    catch_up: Annotated[
        Switch, typer.Option(help="Give stronger items to karts further behind.")
    ] = "on"
    results: Results = ""
    record: Annotated[
        str,
        typer.Option(
            help="Folder for recordings, or none to record nothing. Default: "
            "$RACE_SERVER_RECORDINGS, else ~/.local/share/race-server/recordings."
        ),
    ] = ""

    def __post_init__(self) -> None:
        """Check what names the place.

        Raises:
            ScenarioError: there are two.
        """
        if self.lot and self.track != TRACK:
            raise ScenarioError(f"--lot {self.lot} and --track {self.track}: leave one out")

    @property
    def place(self) -> str:
        """The name of the course or the car park."""
        return self.lot or self.track

    @property
    def car(self) -> str:
        """The name of the vehicle on a course."""
        return self.vehicle or "tt02"


@dataclass(frozen=True)
class ServeOptions(RaceOptions):
    """All options of `race serve`."""

    fill: Annotated[
        str,
        typer.Option(
            help="Comma-separated drivers for seats that stay free, repeated as needed. "
            "Default: none."
        ),
    ] = ""
    one_process: Annotated[
        bool,
        typer.Option(
            "--one-process",
            help="Run all drivers of --fill inside the server. Without it those of other packages, "
            "and those that read a file (NAME:ARGUMENT), each run as a process.",
        ),
    ] = False
    wait_for: Annotated[
        int,
        typer.Option(
            min=-1,
            max=MOST_KARTS,
            help="Start once this many drivers are ready; -1: all seats, or 1 with --fill.",
        ),
    ] = -1
    finish_limit: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=MOST_S,
            help="Seconds that others have to finish after the winner; 0: no limit.",
        ),
    ] = 100.0
    valet: Annotated[
        str,
        typer.Option(help="Where there are slots: the driver in the server that parks on request."),
    ] = VALET
    once: Annotated[bool, typer.Option("--once", help="Exit after one race.")] = False
    review: Annotated[
        float,
        typer.Option(
            min=0.0,
            max=MOST_S,
            help="With --once: seconds after the race in which stewards may still add penalties; "
            "with --format after each stage, and each round of races.",
        ),
    ] = 0.0
    result: Annotated[
        Path | None,
        typer.Option(help="Write the result of each race to this JSON file, replacing the last."),
    ] = None
    listen: Annotated[
        str,
        typer.Option(
            help=f"Address to listen on. Default: {DEFAULT_ADDRESS}, with --open {OPEN_ADDRESS}."
        ),
    ] = ""
    steward_listen: Annotated[
        str,
        typer.Option(
            help="With --open: a second address, for the steward alone, such as "
            "tls/127.0.0.1:7448. Default: none."
        ),
    ] = ""
    is_open: Annotated[
        bool,
        typer.Option("--open", help="Accept clients from other machines; requires --keys."),
    ] = False
    keys: Annotated[
        Path | None,
        typer.Option(help="With --open: folder of keys made by `race keys new`."),
    ] = None
    session: Annotated[
        str,
        typer.Option(
            "--session", help="Name of the session. Default: the one in the keys, else race."
        ),
    ] = ""
    fresh: Annotated[
        bool,
        typer.Option("--fresh", help="Do not resume a race whose server was killed, or an event."),
    ] = False
    guard: Annotated[
        bool,
        typer.Option("--guard/--no-guard", help="Restart the server when it is killed."),
    ] = True
    metrics: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=65535,
            help="Serve /metrics for Prometheus and /healthz on this port of 127.0.0.1; 0: any "
            "free port. Default: off.",
        ),
    ] = None
    log_json: Annotated[
        bool, typer.Option("--log-json", help="Log JSON lines, even to a terminal.")
    ] = False
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON document for each race.")
    ] = False


def check_pace(pace: str) -> None:
    """Check how the world waits for its drivers.

    Raises:
        ScenarioError: there is no such pace.
    """
    if pace not in PACES:
        raise ScenarioError(f"pace {pace!r} is unknown; choose {' or '.join(PACES)}")
