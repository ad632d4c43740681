"""What the words of several commands mean: the race that is wanted, and who drives."""

from typing import Annotated, Literal

import typer

from race_server.errors import ScenarioError

Track = Annotated[str, typer.Option(help="Course to race on: a name from `race track list`.")]
Course = Annotated[
    str,
    typer.Argument(
        help="A name from `race track list`, a .toml file, or a course drawn by lot: "
        "generated:block:SEED, generated:spline:SEED, generated:spline:SEED:kart."
    ),
]
VehicleName = Annotated[
    str, typer.Option("--vehicle", help="tt02, tt02-drift, kart-13, kart-30 or kart-60.")
]
Karts = Annotated[int, typer.Option(min=1, max=64, help="Seats in the race.")]
Laps = Annotated[int, typer.Option(min=1, help="Laps to the finish.")]
Seed = Annotated[int, typer.Option(help="Seed of all chance in the race.")]
Pace = Annotated[
    str,
    typer.Option(help="real: 60 ticks a second. lockstep: the world waits for every driver."),
]
Switch = Literal["on", "off"]
Items = Annotated[Switch, typer.Option(help="Race with items, or without.")]
CatchUp = Annotated[Switch, typer.Option(help="Karts behind draw stronger items, or the same.")]
Results = Annotated[
    str,
    typer.Option(
        help="File that keeps races and laps, or none; without it $RACE_SERVER_RESULTS, or "
        "~/.local/share/race-server/results.sqlite."
    ),
]
Record = Annotated[
    str,
    typer.Option(
        help="Folder for recordings, or none; without it $RACE_SERVER_RECORDINGS, or "
        "~/.local/share/race-server/recordings."
    ),
]


def names_in(text: str) -> tuple[str, ...]:
    """Return the names of a comma-separated list."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def known_drivers(text: str) -> tuple[str, ...]:
    """Return the drivers of a comma-separated list.

    Raises:
        ScenarioError: one of them is not installed.
    """
    from race_server.core.driver import driver_names, installed_name

    names = names_in(text)
    wanted = {installed_name(name) for name in names}
    unknown = sorted(wanted - set(driver_names())) if names else []
    if unknown:
        raise ScenarioError(
            f"driver {', '.join(unknown)} is unknown; "
            f"installed drivers are {', '.join(driver_names())}"
        )
    return names
