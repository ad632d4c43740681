"""Which vehicles a driver is made for, and what it sees the world by.

A driver says the first in its attribute `vehicles`, see `race_server.core.driver.Driver`; the
second follows from its preset.
"""

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from race_server.core.driver import Driver, ParkingDriver, driver_named, driver_names
from race_server.core.observation import PRESETS
from race_server.core.vehicles import KINEMATIC
from race_server.errors import DriverError

# What shows that a preset has a sense: one part of it. Sensors first, then what no sensor tells.
SENSES: Mapping[str, str] = MappingProxyType(
    {
        "lidar": "lidar",
        "radar": "radar",
        "feelers": "feelers",
        "map": "curvature_ahead",
        "line": "line_offset",
        "karts": "karts_x",
        "pose": "position_x",
        "slot": "goal_x",
    }
)


def vehicles_of(driver: Driver) -> tuple[str, ...]:
    """Return the names of the vehicles that a driver is made for; none where it does not say."""
    return tuple(getattr(driver, "vehicles", ()))


def suits(driver: Driver, vehicle: str) -> bool:
    """Return whether a driver is made for a vehicle, or does not say; slip makes no difference."""
    names = vehicles_of(driver)
    return not names or vehicle in names or vehicle.removesuffix(KINEMATIC) in names


def suits_course(driver: Driver, verge: float) -> bool:
    """Return whether a driver sees the edge of the asphalt on a course, or does not need to.

    A driver that `needs_walls` has a lidar and no map: it drives up to the borders. verge: [m] of
    kerb and grass between them and the asphalt.
    """
    return verge == 0.0 or not getattr(driver, "needs_walls", False)


def senses_of(preset: str) -> tuple[str, ...]:
    """Return what a preset shows, in words of `SENSES`; nothing for a preset that is unknown."""
    parts = PRESETS.get(preset, ())
    return tuple(sense for sense, part in SENSES.items() if part in parts)


def suited(vehicle: str, names: Iterable[str] | None = None) -> tuple[str, ...]:
    """Return those of some drivers that are made for a vehicle.

    names: without them all installed drivers that race and need no argument.
    """
    if names is not None:
        return tuple(name for name in names if suits(driver_named(name), vehicle))
    found = []
    for name in driver_names():
        try:
            driver = driver_named(name)
        except DriverError:
            continue
        if not isinstance(driver, ParkingDriver) and suits(driver, vehicle):
            found.append(name)
    return tuple(found)


def check_suits(names: Iterable[str], vehicle: str, way_out: str) -> None:
    """Check that drivers are made for a vehicle.

    way_out: what else may be done, the end of the error's sentence.

    Raises:
        DriverError: one is unknown, or is not.
    """
    for name in dict.fromkeys(names):
        driver = driver_named(name)
        if not suits(driver, vehicle):
            if getattr(driver, "keeps_to_vehicles", False):
                way_out = ""  # it refuses by itself
            raise DriverError(
                f"driver {name} is made for {', '.join(vehicles_of(driver))}, not for {vehicle}; "
                f"choose one that is ({', '.join(suited(vehicle)) or 'none is installed'}){way_out}"
            )
