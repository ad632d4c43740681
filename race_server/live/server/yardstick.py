"""What a vehicle that a driver from outside parks is measured against: the planner's way.

The parking driver of the server plans the same task, from where the vehicle stood when the lights
went out, in another process: no tick waits for it.
"""

from concurrent.futures import Future, wait
from contextlib import suppress
from typing import Any

import numpy as np

from race_server.core.driver import PlanningDriver, driver_named
from race_server.core.messages import PlannedWay
from race_server.core.poses import poses_of
from race_server.core.state import Floats
from race_server.errors import DriverError, PlanError
from race_server.live.local_drivers import LocalDrivers
from race_server.session.parking import parks_from_start
from race_server.session.seats import Seat
from race_server.session.session import Session

# A plan is asked for once a vehicle has driven this way [m]: one that stands needs none.
BEGUN_M = 1.0
# At the end of a race plans that are still being made are waited for [s].
PATIENCE_S = 3.0


class Yardstick:
    """The plans of one race in a car park, by seat."""

    def __init__(self, session: Session, local_drivers: LocalDrivers, valet: str) -> None:
        """Measure nothing yet. valet: name of the parking driver that plans; "" for none."""
        self._session, self._local_drivers, self._valet = session, local_drivers, valet
        self._starts: Floats = np.zeros((0, 4))
        self._asked: dict[int, Future[PlannedWay | None]] = {}
        self._planner: PlanningDriver | None = None

    def begin(self) -> None:
        """Note where all vehicles stand at the start of a race."""
        session, self._asked = self._session, {}
        self._starts = np.zeros((0, 4))
        if not (self._valet and parks_from_start(session.world)):
            return
        self._starts = poses_of(session.world.bodies[0], session.world.vehicles[0])
        with suppress(DriverError):  # none that is installed plans
            driver: Any = driver_named(self._valet)
            self._planner = driver if isinstance(driver, PlanningDriver) else None

    def look(self) -> None:
        """Ask for the plans of vehicles that have set off, and hand out those that are made."""
        if self._planner is None or not len(self._starts):
            return
        for seat in self._session.seats.taken():
            number = seat.number
            asked = self._asked.get(number)
            if asked is None and self._drives_itself(seat):
                self._asked[number] = self._planner.ask_plan(
                    self._session.scenario.vehicle_of(number),
                    self._starts[number],
                    self._session.standing_orders[number],
                )
            elif asked is not None and asked.done() and seat.planned is None:
                with suppress(PlanError):
                    seat.planned = asked.result()

    def settle(self) -> None:
        """Hand out the plans of a race that is over, also those that come a little late."""
        wait(self._asked.values(), timeout=PATIENCE_S)
        self.look()

    def _drives_itself(self, seat: Seat) -> bool:
        """Return whether a driver from outside is on the way to the slot that the round drew."""
        parker = self._session.world.parking.parkers[0, seat.number]
        slot = self._session.standing_orders[seat.number].slot
        is_own = bool((parker.x, parker.y) == (slot.x, slot.y))
        is_outside = not seat.is_led and seat.number not in self._local_drivers
        return is_outside and is_own and float(parker.way) > BEGUN_M
