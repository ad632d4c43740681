"""The drivers inside the server: those of seats that it fills, and its parking drivers.

A parking driver takes the wheel of a kart whose driver, or whose steward, asks for it. Flags and
the clock of race control stay above it, as above every driver.
"""

from collections.abc import Callable
from contextlib import suppress

import numpy as np

from race_server.core import codes
from race_server.core.driven import are_driven, races_first
from race_server.core.driver import (
    Driver,
    ParkingDriver,
    PlanningDriver,
    driver_named,
    tell_to_park,
)
from race_server.core.observation import Observation
from race_server.core.state import Floats, World
from race_server.errors import DriverError, Reason, SeatError
from race_server.live.local_drivers import LocalDrivers, briefing_for, order_for, raised
from race_server.live.server.counters import Counters
from race_server.live.suspects import Suspects
from race_server.net.wire.drive import ControlFrame, decode_control, encode_control
from race_server.session.observations import Observations
from race_server.session.parking import check_slot, has_lot, parks_after_race
from race_server.session.session import Session

# The driver that parks, where the server names no other.
VALET = "valet"


class Wheels:
    """All drivers inside the server, as they are asked for their controls."""

    def __init__(
        self,
        session: Session,
        local_drivers: LocalDrivers,
        counters: Counters,
        suspects: Suspects,
        valet: str,
    ) -> None:
        """Begin with no parking driver. valet: name of the driver that parks."""
        self._session, self._local_drivers, self._valet = session, local_drivers, valet
        self._counters, self._suspects = counters, suspects
        self._valets: dict[int, Driver] = {}  # by seat
        self._observations = Observations(len(session.seats), session.scenario.lidar.rays)

    def drive(self, receive: Callable[[int, bytes], None]) -> None:
        """Let every driver inside answer what it observes now. receive: a control of a seat."""
        if has_lot(self._session.world):
            self._lead_finished()
            self._local_drivers.traffic.watch(self._session.world, 0)
        for seat in self._session.lined_up():
            if seat.number in self._local_drivers:
                self._drive_locally(seat.number, receive)
        if self._valets:
            self._observations.compute(self._session.world)
            driven = are_driven(self._session.world)
            for number in [seat for seat in self._valets if driven[seat]]:
                self._lead(number)

    def _lead_finished(self) -> None:
        """Take the wheels of karts that have finished a race and go to a slot.

        One that cannot be led does not go to a slot any more: the race would wait for it.
        """
        session = self._session
        if not races_first(session.world):
            return
        for number in np.flatnonzero(session.world.bodies["status"][0] == codes.FINISHED).tolist():
            seat = session.seats[number]
            goes = not seat.is_tracked and are_driven(session.world)[number]
            goes = goes and not seat.keeps_wheel
            if goes and number not in self._valets and not self._retake(number):
                self._counters.refused.record(Reason.DRIVER, number)
                session.race_control.cancel_parking(number)
            elif goes and not seat.is_led:
                session.race_control.hand_wheel(number, to_server=True)

    def _drive_locally(self, number: int, receive: Callable[[int, bytes], None]) -> None:
        try:
            control = self._local_drivers.answer(number)
        except DriverError:
            self._counters.refused.record(Reason.DRIVER, number)
            self._session.drop(number)
            return
        receive(number, control)

    def _lead(self, number: int) -> None:
        """Let a parking driver answer; one that fails gives the wheel back."""
        session, valet = self._session, self._valets[number]
        seen = self._observations.of(number).copy()
        observation = Observation(session.tick, session.layout(valet.preset), seen)
        try:
            with self._suspects.asking(number):
                control = valet.act(observation)
            # As over the network, so that the same numbers are refused.
            frame = ControlFrame(session.epoch, 0, session.tick, control)
            control = decode_control(encode_control(frame)).control
        except (Exception, SystemExit):
            self._counters.refused.record(Reason.DRIVER, number)
            self._give_back(number)
            if races_first(session.world):
                session.race_control.cancel_parking(number)
            return
        session.seats[number].lead(control, session.tick)

    def park(self, number: int, slot: int = -1) -> None:
        """Have the vehicle of a seat parked. slot: number, -1 for the one that it has.

        A real kart is sent the order, and a driver inside that parks is given it; of any other
        kart the parking driver takes the wheel. Where there is a race to finish, it does so after
        the finish.

        Raises:
            SeatError: no race is on, the vehicle is not driven, the slot is not free, or there is
                no driver that parks.
        """
        session = self._session
        seat = session.seat(number)
        after_race = parks_after_race(session.world)
        is_home = after_race and session.is_on and _is_home(session.world, number)
        if not (session.is_racing(number) or is_home):
            raise SeatError(f"the vehicle of seat {number} does not drive now", Reason.DECISION)
        check_slot(session.world, number, slot)
        inside = isinstance(self._local_drivers.driver_of(number), ParkingDriver)
        try:
            if seat.is_tracked:
                session.race_control.park(number, slot)
            elif inside and not after_race:
                session.race_control.park(number, slot)
                self._tell(number)
            else:
                valet = driver_named(self._valet)  # before anything is recorded
                session.race_control.park(number, slot)
                if not after_race or is_home:  # else it takes the wheel after the finish
                    self._take_wheel(number, valet)
                    if not seat.is_led:
                        session.race_control.hand_wheel(number, to_server=True)
        except DriverError as error:
            raise SeatError(str(error), Reason.DRIVER) from error

    def _tell(self, number: int) -> None:
        """Give a driver inside its order; one that raises an error is out.

        Raises:
            DriverError: it raised one.
        """
        try:
            self._local_drivers.park(number)
        except DriverError:
            self._counters.refused.record(Reason.DRIVER, number)
            self._session.drop(number)
            raise

    def _take_wheel(self, number: int, driver: Driver) -> None:
        """Let a new parking driver take a kart over.

        Raises:
            DriverError: it cannot park, or ended a server before this one.
        """
        session = self._session
        if self._suspects.is_barred(number):
            raise DriverError(f"the parking driver of seat {number} ended the server: it is barred")
        waits, traffic = self._local_drivers.waits, self._local_drivers.traffic
        try:
            with self._suspects.asking(number):
                driver.reset(briefing_for(session, session.seats[number], waits=waits))
                tell_to_park(driver, self._valet, order_for(session, number), traffic)
                self._observations.show(number, driver.preset)
        except (Exception, SystemExit) as error:
            self._give_back(number)  # another may have been on its way to another slot
            if isinstance(error, DriverError):
                raise
            raise raised(self._valet, error) from error
        self._valets[number] = driver

    def release(self, number: int) -> None:
        """Give the wheel of a kart back to its driver, or forget that it asked for a slot.

        Of a kart that races on, the request is dropped, but for a real one, which has its order;
        one that has finished drives to its slot itself.
        """
        session, world = self._session, self._session.world
        if number in self._valets:
            self._give_back(number)
        elif parks_after_race(world) and not session.seats[number].is_tracked:
            if session.is_racing(number):
                session.race_control.cancel_parking(number)
            elif are_driven(world)[number]:  # its wheel is about to be taken
                session.race_control.hand_wheel(number, to_server=False)

    def _give_back(self, number: int) -> None:
        if self._valets.pop(number, None):
            self._local_drivers.traffic.withdraw(number)
            self._observations.show(number, "")
            self._session.race_control.hand_wheel(number, to_server=False)

    def ways(self) -> dict[int, Floats]:
        """Return what the drivers inside have planned, by seat: (N, 2) of the body's middle [m]."""
        driven = are_driven(self._session.world)
        ways = {}
        for seat in self._session.seats.taken():
            driver: object = self._valets.get(seat.number)
            driver = driver or self._local_drivers.driver_of(seat.number)
            if not (isinstance(driver, PlanningDriver) and driven[seat.number]):
                continue
            try:
                if len(points := driver.way_ahead()):
                    ways[seat.number] = points
            except Exception:  # of a foreign driver: its way is not shown
                self._counters.refused.record(Reason.DRIVER, seat.number)
        return ways

    def resume(self) -> None:
        """Take the wheels again that the server before this one had."""
        for seat in self._session.seats.taken():
            is_driven = self._session.is_on and are_driven(self._session.world)[seat.number]
            if not (seat.is_led and is_driven):
                continue
            if not self._retake(seat.number):
                self._counters.refused.record(Reason.DRIVER, seat.number)
                self._session.race_control.hand_wheel(seat.number, to_server=False)

    def _retake(self, number: int) -> bool:
        """Take a wheel again; False where the parking driver is barred or cannot park any more."""
        with suppress(DriverError):
            self._take_wheel(number, driver_named(self._valet))
            return True
        return False

    def clear(self) -> None:
        """Begin a race: no parking driver drives."""
        for number in list(self._valets):
            self._local_drivers.traffic.withdraw(number)
            self._observations.show(number, "")
        self._valets.clear()


def _is_home(world: World, number: int) -> bool:
    """Return whether a kart has finished, and is not parked yet."""
    has_finished = int(world.bodies["status"][0, number]) == codes.FINISHED
    return has_finished and not world.parking.parkers["parked_tick"][0, number]
