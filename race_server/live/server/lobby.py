"""The time between races: drivers come and get ready, and after the last race they are seen off."""

import math
import time
from collections.abc import Callable, Sequence

from race_server.errors import DriverError
from race_server.live.driver_processes import DriverProcesses
from race_server.live.local_drivers import LocalDrivers
from race_server.live.server.timing import ServerTiming
from race_server.logs import Log
from race_server.net.transport import ServerLink
from race_server.session.session import Session


class Lobby:
    """Waits for drivers while no race is on."""

    def __init__(
        self,
        session: Session,
        link: ServerLink,
        drivers: tuple[LocalDrivers, DriverProcesses],
        timing: ServerTiming,
        poll: Callable[[], bool],
        log: Log | None = None,
    ) -> None:
        """Wait at a link.

        drivers: those inside the server, and those that it keeps apart; poll: receives what has
        come, and returns False once the server was told to stop.
        """
        self._session, self._link, self._timing, self._poll = session, link, timing, poll
        self._log = log
        self._inside, self._apart = drivers

    def gather(self, drivers: int, fillers: Sequence[str]) -> None:
        """Wait until `drivers` drivers are ready, and give the free seats to fillers.

        fillers: names of drivers of the server, repeated in turn.

        Raises:
            DriverError: there are fillers, and no driver at all.
        """
        self.wait_for(drivers)
        self.fill(fillers)
        self.wait_for(drivers)

    def fill(self, fillers: Sequence[str]) -> None:
        """Give the free seats to the drivers of the server, and wait until they are ready.

        Raises:
            DriverError: there are fillers, and no driver at all.
        """
        if not self._poll():
            return
        apart = self._apart.fill(self._session, fillers)
        self._inside.fill(fillers, but=apart)
        goes_on = self.wait_until(lambda: not self._apart.are_coming(self._session))
        if fillers and goes_on and not self._session.seats.taken():
            raise DriverError(f"no driver of {', '.join(fillers)} can take part; see the log")

    def wait_for(self, drivers: int) -> None:
        """Wait until `drivers` seats are taken and all their drivers are ready.

        A seat that is closed and free is not awaited; what still is, is logged when one is closed
        or opened. Where all are closed one driver is awaited.
        """
        seats, known = self._session.seats, ""

        def can_start() -> bool:
            nonlocal known
            taken = len(seats.taken())
            awaited = min(drivers, max(taken + len(seats.vacant()), 1))
            if taken >= awaited and (taken == 0 or self._session.can_start()):
                return True
            closed = ", ".join(map(str, sorted(seats.closed)))
            if closed != known and self._log:
                ready = sum(seat.is_ready for seat in seats.taken())
                missing = max(awaited - ready, 0)
                self._log.say("waiting for drivers", missing=missing, closed=closed or "none")
            known = closed
            return False

        self.wait_until(can_start)

    def wait_until(self, is_so: Callable[[], bool], timeout_s: float = math.inf) -> bool:
        """Wait until a condition holds; False where time is over or the server is told to stop."""
        deadline = time.monotonic() + timeout_s
        while self._poll():
            if is_so():
                return True
            if time.monotonic() > deadline:
                return False
            self._link.wait(self._timing.poll_s)
        return False

    def see_off(self, repeat: Callable[[], None], review_s: float) -> None:
        """Send drivers the end until they have gone: on a bad network the first message is lost.

        repeat: sends the end again; review_s: for at least this long stewards may change the
        result.
        """
        begun, again = time.monotonic(), 0.0

        def have_gone() -> bool:
            nonlocal again
            now = time.monotonic()
            linked = (seat for seat in self._session.seats.taken() if seat.is_present)
            if now >= begun + review_s and all(seat.number in self._inside for seat in linked):
                return True
            if now > again:
                again = now + self._timing.repeat_s
                repeat()
            return False

        self.wait_until(have_gone, max(self._timing.see_off_s, review_s))
