"""`race drivers`: which drivers there are, for which vehicles, and what they see."""

from typing import TYPE_CHECKING, Annotated, Any

import typer

from race_server.cli.document import AsJson, print_document
from race_server.terminal import Console

if TYPE_CHECKING:
    from race_server.core.driver import Driver


def drivers(
    vehicle: Annotated[
        str, typer.Option(help="Show only those that are made for this vehicle.")
    ] = "",
    as_json: AsJson = False,
) -> None:
    """List the installed drivers: for which vehicles each is made, and what it sees.

    Of those that take an argument (a policy, another driver) it is the argument that decides.
    """
    from race_server.core.driver import driver_names
    from race_server.core.vehicle_presets import vehicle_named

    if vehicle:
        vehicle_named(vehicle)
    rows = [row for name in driver_names() if (row := _row_of(name, vehicle)) is not None]
    if as_json:
        print_document({"drivers": rows})
        return
    from rich.table import Table

    table = Table("driver", "vehicles", "sees", "")
    for row in rows:
        vehicles = ", ".join(_grouped(row["vehicles"])) or "any"
        words = ("by its argument",) * 2 if row["takes_argument"] else (vehicles, _sees(row))
        table.add_row(row["name"], *words, row["description"])
    Console().print(table)


def _row_of(name: str, vehicle: str) -> dict[str, Any] | None:
    """Return what is known of a driver; None for one that is not made for a vehicle, if given."""
    from race_server.core.driver import description_of, driver_named
    from race_server.core.suitability import senses_of, suits, vehicles_of
    from race_server.errors import DriverError

    try:
        driver: Driver | None = driver_named(name)
    except DriverError:
        driver = None
    if driver is not None and vehicle and not suits(driver, vehicle):
        return None
    return {
        "name": name,
        "takes_argument": driver is None,
        "vehicles": vehicles_of(driver) if driver else (),
        "senses": senses_of(driver.preset) if driver else (),
        "description": description_of(name),
    }


def _sees(row: dict[str, Any]) -> str:
    return ", ".join(row["senses"])


def _grouped(vehicles: tuple[str, ...]) -> list[str]:
    """Return vehicles by name; all of a scale as the scale."""
    from race_server.core.vehicle_presets import KARTS, TENTH

    groups = {"1/10": TENTH, "karts": KARTS}
    whole = {title: names for title, names in groups.items() if set(names) <= set(vehicles)}
    grouped = {name for names in whole.values() for name in names}
    return [*whole, *(name for name in vehicles if name not in grouped)]
