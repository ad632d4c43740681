"""Drivers inside this process, for seats of a session that no network fills."""

from collections.abc import Container, Sequence
from dataclasses import dataclass

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.driver import Briefing, Driver, ParkingDriver, driver_named, tell_to_park
from race_server.core.observation import Observation
from race_server.core.parking_order import ParkingOrder, order_of
from race_server.core.rules.items import items
from race_server.core.traffic import Traffic
from race_server.errors import DriverError
from race_server.live.suspects import Suspects
from race_server.net.wire.drive import ControlFrame, encode_control
from race_server.session.parking import parks_from_start
from race_server.session.seats import Seat
from race_server.session.session import Session


def briefing_for(session: Session, seat: Seat, *, waits: bool = False) -> Briefing:
    """Return the briefing of the driver of a seat. waits: the session stands while it decides."""
    scenario = session.scenario
    return Briefing(
        seat=seat.number,
        vehicle=scenario.vehicle_of(seat.number),
        laps=scenario.rules.laps,
        preset=seat.preset,
        decision_s=session.decision_ticks / TICKS_PER_SECOND,
        items=tuple(item.name for item in items()),
        lidar_field=scenario.lidar.field,
        lidar_reach=scenario.lidar.reach,
        waits=waits,
    )


def order_for(session: Session, number: int) -> ParkingOrder:
    """Return the order to park of the vehicle of a seat, with what stands there now."""
    if session.is_on:
        return order_of(session.world, 0, number)
    return session.standing_orders[number]


@dataclass
class _LocalDriver:
    driver: Driver
    sequence: int = 0


class LocalDrivers:
    """The local drivers of a session, by seat."""

    def __init__(
        self, session: Session, suspects: Suspects | None = None, *, waits: bool = False
    ) -> None:
        """Begin with none. suspects: is told which driver is asked; waits: see `Briefing`."""
        self._session, self._suspects, self.waits = session, suspects or Suspects(), waits
        self._locals: dict[int, _LocalDriver] = {}
        # What those drivers inside that park share of their ways.
        self.traffic = Traffic(session.world.bodies.shape[1])

    def __contains__(self, seat: object) -> bool:
        return seat in self._locals

    def driver_of(self, seat: int) -> Driver | None:
        """Return the local driver of a seat, None where there is none."""
        local = self._locals.get(seat)
        return local.driver if local else None

    def admit(self, name: str, driver: Driver, seat: int) -> None:
        """Give a driver a seat in the lobby, ready to race.

        Raises:
            SeatError: the seat is taken, or the driver wants an unknown observation.
            DriverError: the driver raised.
        """
        taken = self._session.join(name, driver.preset, wanted=seat)
        taken.is_ready = True
        self._get_ready(name, driver, taken)

    def _get_ready(self, name: str, driver: Driver, taken: Seat) -> None:
        self._locals[taken.number] = _LocalDriver(driver)
        try:
            driver.reset(briefing_for(self._session, taken, waits=self.waits))
            if parks_from_start(self._session.world) and isinstance(driver, ParkingDriver):
                tell_to_park(driver, name, order_for(self._session, taken.number), self.traffic)
        except (Exception, SystemExit) as error:
            raise raised(name, error) from error

    def park(self, seat: int) -> None:
        """Give a driver that parks the order that its vehicle has now.

        Raises:
            DriverError: the driver raised.
        """
        driver, name = self._locals[seat].driver, self._session.seats[seat].driver
        assert isinstance(driver, ParkingDriver)
        try:
            with self._suspects.asking(seat):
                driver.park(order_for(self._session, seat))
        except (Exception, SystemExit) as error:
            raise raised(name, error) from error

    def fill(self, names: Sequence[str], *, but: Container[int] = ()) -> None:
        """Give the free seats of the lobby to drivers of these names, repeated in turn.

        but: seats that others fill.
        """
        for seat in self._session.seats.vacant() if names else ():
            if seat.number not in but and not self._suspects.is_barred(seat.number):
                name = names[seat.number % len(names)]
                with self._suspects.asking(seat.number):
                    self.admit(name, driver_named(name), seat.number)

    def readmit(self, name: str, seat: int) -> None:
        """Give the driver of a name its seat in a race that is resumed, unless it is barred.

        Raises:
            DriverError: the driver raised.
        """
        if self._suspects.is_barred(seat):
            return
        with self._suspects.asking(seat):
            self._session.come_back(seat)
            self._get_ready(name, driver_named(name), self._session.seats[seat])

    def renew(self) -> None:
        """Make each driver again for a race in which it takes part; one that fails is away."""
        for seat in self._session.lined_up():
            if seat.number in self._locals:
                try:
                    self.readmit(seat.driver, seat.number)
                except DriverError:
                    self._session.drop(seat.number)

    def answer(self, seat: int) -> bytes:
        """Return a driver's control for its observation now: the same bytes as over the network.

        Raises:
            DriverError: the driver raised, or what it returned is no control.
        """
        session, local = self._session, self._locals[seat]
        taken = session.seats[seat]
        layout = session.layout(taken.preset)
        seen = Observation(session.tick, layout, session.view(seat).copy())
        local.sequence = max(local.sequence, taken.sequence) + 1
        try:
            with self._suspects.asking(seat):
                control = local.driver.act(seen)
            frame = ControlFrame(session.epoch, local.sequence, session.tick, control)
            return encode_control(frame)
        except (Exception, SystemExit) as error:
            raise raised(taken.driver, error) from error

    def clear(self) -> None:
        """Remove all local drivers; their seats are free again."""
        for seat in self._locals:
            if self._session.seats[seat].is_taken:
                self._session.leave(seat)
        self._locals.clear()


def raised(name: str, error: BaseException) -> DriverError:
    """Return what to say of a driver that raised an error."""
    return DriverError(f"driver {name!r} raised {type(error).__name__}: {error}")
