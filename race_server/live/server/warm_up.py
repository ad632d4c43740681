"""Everything that a race needs, done once before anybody waits for it."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from race_server.core.driver import driver_named
from race_server.core.messages import Flag
from race_server.core.state import PLACEMENT
from race_server.errors import DriverError
from race_server.live.local_drivers import LocalDrivers
from race_server.scenario.race import Scenario
from race_server.session import Session


def warm_up(scenario: Scenario, drivers: Sequence[str] = ()) -> None:
    """Compile, or load, every kernel of a race; nothing may do so while karts are on the track.

    drivers: those that drive from inside the server, whose kernels are its own.
    """
    for name in dict.fromkeys(drivers):
        with suppress(DriverError):  # it will be out with a reason when its turn comes
            _let_decide(name, scenario)
    rehearsal = Session("rehearsal", scenario)
    rehearsal.join("nobody", "full")
    rehearsal.start()
    rehearsal.look()
    rehearsal.advance(1)
    rehearsal.show_flag(Flag.YELLOW)
    rehearsal.penalise(0, 1.0)
    rehearsal.penalise_late(0, 1.0)
    rehearsal.place_karts(np.zeros((1, len(PLACEMENT))))
    rehearsal.leave(0)


def _let_decide(name: str, scenario: Scenario) -> None:
    alone = Session("rehearsal", replace(scenario, karts=1))
    local_drivers = LocalDrivers(alone)
    local_drivers.admit(name, driver_named(name), 0)
    alone.start()
    alone.look()
    local_drivers.answer(0)
