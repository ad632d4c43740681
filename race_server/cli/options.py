"""Options and arguments that several commands share."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Annotated

import typer

from race_server.core.seeds import MOST_SEED
from race_server.errors import ScenarioError

# More would be days of driving, or no number that a world keeps.
MOST_LAPS = 100_000

Track = Annotated[
    str,
    typer.Option(
        help="Course to race on: a name from `race track list`, a .toml file, or a generated "
        "course such as generated:spline:SEED."
    ),
]
Course = Annotated[
    str,
    typer.Argument(
        help="A name from `race track list`, a .toml file, or a generated course: "
        "generated:block:SEED, generated:spline:SEED[:kart], generated:circuit:SEED[:kart]."
    ),
]
VehicleName = Annotated[
    str,
    typer.Option(
        "--vehicle",
        help="Vehicle: tt02, tt02-drift, kart-13, kart-30, kart-60, car; an unknown name lists "
        "all.",
    ),
]
Unfit = Annotated[
    bool,
    typer.Option(
        "--unfit", help="Let drivers drive vehicles that they are not made for, see `race drivers`."
    ),
]
Picture = Annotated[
    Path | None, typer.Option("--to", help="File to write: .png or .svg. Default: NAME.png.")
]
Language = Annotated[str, typer.Option(help="Language of tables and sheet: en or fr.")]
Results = Annotated[
    str,
    typer.Option(
        help="Results file for races and laps, or none to keep nothing. Default: "
        "$RACE_SERVER_RESULTS, else ~/.local/share/race-server/results.sqlite."
    ),
]


def picture_of(name: str) -> Path:
    """Return the file that a picture of a course or a car park is written to by default."""
    return Path(f"{name.replace(':', '-')}.png")


def names_in(text: str) -> tuple[str, ...]:
    """Return the names of a comma-separated list."""
    return tuple(name.strip() for name in text.split(",") if name.strip())


def once(names: Iterable[str]) -> tuple[str, ...]:
    """Return names in their order, each once: one that is given twice is no second sample."""
    return tuple(dict.fromkeys(names))


def seeds_from(first: int, count: int, option: str = "--first-seed") -> range:
    """Return the seeds of `count` tasks, that of the first and those that count up from it.

    option: gives the first one, in the error.

    Raises:
        ScenarioError: the last one is larger than a seed can be.
    """
    if first + count - 1 > MOST_SEED:
        raise ScenarioError(
            f"{option} {first}: the last of {count} seeds is {first + count - 1}, and a seed "
            f"may be {MOST_SEED}; choose a smaller one"
        )
    return range(first, first + count)


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


def drivers_for(
    text: str,
    usual: Sequence[str],
    vehicles: Sequence[str],
    *,
    unfit: bool,
    courses: Sequence[str] = (),
) -> tuple[str, ...]:
    """Return the drivers of a comma-separated list, all of them made for the vehicles.

    usual: where the list is empty those of them that are, and for the courses, too; unfit: any
    driver is taken that is named.

    Raises:
        ScenarioError: one of them is not installed.
        VehicleError: one of the vehicles does not exist.
        TrackError: one of the courses does not, and the list is empty.
        DriverError: one of them is not made for one of the vehicles.
    """
    from race_server.core.driver import driver_named
    from race_server.core.suitability import check_suits, suited, suits_course
    from race_server.core.vehicle_presets import vehicle_named

    for vehicle in vehicles:
        vehicle_named(vehicle)
    names = known_drivers(text)
    if not names:
        names = tuple(usual)
        for vehicle in vehicles:
            names = suited(vehicle, names)
        verge = max((verge_of(course) for course in courses), default=0.0)
        return tuple(name for name in names if suits_course(driver_named(name), verge))
    if not unfit:
        for vehicle in vehicles:
            check_suits(names, vehicle, ", or let it drive with --unfit")
    return names


def verge_of(track: str) -> float:
    """Return how wide kerb and grass of a course are [m].

    Raises:
        TrackError: there is no such course.
    """
    from race_server.scenario.track.load import load_course

    course = load_course(track)
    return course.kerb + course.grass


def refuse_options(context: typer.Context, names: Iterable[str], why: str) -> None:
    """Refuse options that stand on the command line beside what they do not go with.

    Raises:
        ScenarioError: names the first of them, with its value and why.
    """
    for name in names:
        source = context.get_parameter_source(name)
        if source is not None and source.name != "DEFAULT":
            raise ScenarioError(f"--{name} {context.params[name]}: {why}")
