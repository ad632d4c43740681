"""Options and arguments that several commands share."""

from typing import Annotated

import typer

from race_server.errors import ScenarioError

Track = Annotated[str, typer.Option(help="Course to race on: a name from `race track list`.")]
Course = Annotated[
    str,
    typer.Argument(
        help="A name from `race track list`, a .toml file, or a generated course: "
        "generated:block:SEED, generated:spline:SEED, generated:spline:SEED:kart."
    ),
]
VehicleName = Annotated[
    str,
    typer.Option("--vehicle", help="Vehicle: tt02, tt02-drift, kart-13, kart-30, kart-60 or car."),
]
Results = Annotated[
    str,
    typer.Option(
        help="Results file for races and laps, or none to keep nothing. Default: "
        "$RACE_SERVER_RESULTS, else ~/.local/share/race-server/results.sqlite."
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
