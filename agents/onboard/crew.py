"""The drivers of a real kart: one that races, and one that parks once it is told to."""

from dataclasses import dataclass

from race_agents.onboard.parker import KartState, Parker
from race_agents.unit.control_unit import STOP
from race_server.core.driver import Driver
from race_server.core.messages import Control
from race_server.core.observation import Observation
from race_server.net.wire.parking import OrderFrame


@dataclass
class Crew:
    """The drivers of one kart. Without a racer the kart stands until it is told to park."""

    racer: Driver | None
    parker: Parker | None = None
    races_first: bool = True  # as on a course: it parks after the finish
    _is_home: bool = False
    _epoch: int = -1  # of the race that it drives

    def act(
        self,
        seen: Observation | None,
        order: OrderFrame | None,
        kart: KartState,
        now_s: float,
    ) -> Control | None:
        """Return the decision of the driver that has the wheel, None if there is nothing new.

        seen: what the server shows the racer, if there is something new; order: to park, if one
        has come.
        """
        parker = self.parker
        if kart.hud is not None and kart.hud.epoch != self._epoch:
            self._epoch, self._is_home = kart.hud.epoch, False
        self._is_home |= seen is not None and seen.scalar("finished") > 0.0
        if parker is not None:
            parker.take(order)
            if parker.has_order(self._epoch) and (self._is_home or not self.races_first):
                return parker.act(kart, now_s)
        if self.racer is None:
            return STOP
        return self.racer.act(seen) if seen is not None else None

    def close(self) -> None:
        """Ask the parking driver for nothing more."""
        if self.parker is not None:
            self.parker.close()
