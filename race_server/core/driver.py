"""The interface of drivers: the briefing they get, what they observe, what they answer."""

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from importlib.metadata import entry_points
from inspect import getdoc, signature
from typing import Protocol, cast, runtime_checkable

from race_server.core.messages import Control, PlannedWay
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder
from race_server.core.state import Floats
from race_server.core.traffic import Traffic
from race_server.core.vehicles import Vehicle
from race_server.errors import DriverError

ENTRY_POINTS = "race_server.drivers"
# Of a way that is shown.
MOST_POINTS = 60


@dataclass(frozen=True)
class Briefing:
    """What a driver knows before the start. It holds no map: see `ParkingDriver.park`."""

    seat: int
    vehicle: Vehicle
    laps: int
    preset: str
    decision_s: float  # time between two observations [s]
    items: tuple[str, ...] = ()  # names of the items; item number 1 is the first
    lidar_field: float = 0.0  # [rad] between the outermost rays
    lidar_reach: float = 8.0  # [m]
    # Whether the world stands still while the driver decides, so that results depend on no clock.
    waits: bool = False


class Driver(Protocol):
    """Answers each observation with a control.

    `preset` names the observation that the driver wants, see `race_server.core.observation`. A
    driver may have an attribute `vehicles` too, the names of those that it is made for; one
    without it drives any; and `needs_walls`, if it sees borders alone and no edge of the
    asphalt. See `race_server.core.suitability`.
    """

    preset: str

    def reset(self, briefing: Briefing) -> None:
        """Get ready for a new race."""

    def act(self, observation: Observation) -> Control:
        """Return what to do until the next observation."""


@runtime_checkable
class ParkingDriver(Driver, Protocol):
    """A driver that is told where to park, and what stands there."""

    def park(self, order: ParkingOrder) -> None:
        """Drive to a slot from the next observation on, and stay there.

        It comes after `reset`, also in the middle of a race; another order replaces it.

        Raises:
            DriverError: the driver cannot park.
        """


@runtime_checkable
class YieldingDriver(ParkingDriver, Protocol):
    """A driver that shares its way with those of other vehicles, and gives way to them."""

    def join(self, traffic: Traffic) -> None:
        """Announce ways, and keep to what is cleared; it comes after `reset`, before `park`."""


@runtime_checkable
class PlanningDriver(ParkingDriver, Protocol):
    """A driver that plans its whole way before it drives it."""

    def way_ahead(self) -> Floats:
        """Return the way that it is on, (N, 2): x, y [m] of the middle of the body, or none.

        N is at most `MOST_POINTS`.
        """

    def ask_plan(
        self, vehicle: Vehicle, start: Floats, order: ParkingOrder
    ) -> "Future[PlannedWay | None]":
        """Return how a task is planned, once another process has found that; None for no way.

        start: (4,), see `race_server.core.poses.poses_of`.
        """


def tell_to_park(
    driver: Driver, name: str, order: ParkingOrder, traffic: Traffic | None = None
) -> None:
    """Hand an order to a driver of a name, and what is known of other vehicles, if anything is.

    Raises:
        DriverError: it cannot park.
    """
    driver = as_parking(driver, name)
    if traffic is not None and isinstance(driver, YieldingDriver):
        driver.join(traffic)
    driver.park(order)


def check_parks(name: str) -> None:
    """Check that the driver of a name takes orders to park.

    Raises:
        DriverError: there is none, or it takes none.
    """
    as_parking(driver_named(name), name)


def as_parking(driver: Driver, name: str) -> ParkingDriver:
    """Return a driver of a name as one that takes orders to park.

    Raises:
        DriverError: it takes none.
    """
    if isinstance(driver, ParkingDriver):
        return driver
    raise DriverError(
        f"driver {name!r} cannot park: it takes no order; choose one that does, such as valet"
    )


# Called with what stands behind the colon of a name, or with nothing.
DriverFactory = Callable[..., Driver]


def driver_names() -> list[str]:
    """Return the names of all installed drivers."""
    return sorted({point.name for point in entry_points(group=ENTRY_POINTS)})


def description_of(name: str) -> str:
    """Return the first sentence of a driver's own description; empty where there is none."""
    for point in entry_points(group=ENTRY_POINTS):
        if point.name == name:
            try:
                text = getdoc(point.load()) or ""
            except Exception:  # a driver that cannot be loaded says so when it is to drive
                return ""
            return text.split("\n\n")[0].split(". ")[0].replace("\n", " ").rstrip(".")
    return ""


def installed_name(name: str) -> str:
    """Return the name under which a driver is installed: what stands before a colon."""
    return name.partition(":")[0]


def driver_named(name: str) -> Driver:
    """Return a new driver of the class that an installed package offers under `name`.

    ``NAME:ARGUMENT`` hands the class an argument, for instance ``unstuck:follow_gap``.

    Raises:
        DriverError: there is none, it takes no argument or needs one, or it cannot be imported
            or made.
    """
    installed, colon, argument = name.partition(":")
    points = [point for point in entry_points(group=ENTRY_POINTS) if point.name == installed]
    if not points:
        known = ", ".join(driver_names())
        raise DriverError(f"driver {installed!r} is unknown; installed drivers are {known}")
    arguments = (argument,) if colon else ()
    try:
        factory = cast("DriverFactory", points[0].load())
        _check_arguments(factory, installed, arguments)
        return factory(*arguments)
    except DriverError:
        raise
    except Exception as error:
        reason = f"{type(error).__name__}: {error}"
        raise DriverError(
            f"driver {name!r} from {points[0].value} cannot start: {reason}"
        ) from error


def _check_arguments(factory: DriverFactory, installed: str, arguments: tuple[str, ...]) -> None:
    try:
        signature(factory).bind(*arguments)
    except TypeError as error:
        raise DriverError(
            f"driver {installed!r} takes no argument; leave out {':' + arguments[0]!r}"
            if arguments
            else f"driver {installed!r} needs an argument; write {installed}:ARGUMENT"
        ) from error
