"""What is done before a race so that no tick has to wait for it."""

import gc
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace

import numpy as np

from race_server.core.driver import ParkingDriver, driver_named
from race_server.core.messages import Flag
from race_server.core.state import PLACEMENT
from race_server.errors import DriverError
from race_server.live.local_drivers import LocalDrivers
from race_server.scenario.race import Scenario
from race_server.session.parking import parks_after_race
from race_server.session.session import Session


def warm_up(scenario: Scenario, drivers: Sequence[str] = ()) -> None:
    """Compile, or load, every kernel of a race; no tick may wait for that.

    What was made until then stays as long as the process, and the garbage collector leaves it out
    from here on: to walk through all that a compiler leaves takes half a second.

    drivers: those that drive from inside the server, whose kernels are its own.
    """
    for name in dict.fromkeys(drivers):
        with suppress(DriverError):  # in its race it will be out, with the reason
            _let_decide(name, scenario)
    _rehearse(scenario)
    gc.unfreeze()  # of a call before
    gc.collect()
    gc.freeze()


def _rehearse(scenario: Scenario) -> None:
    rehearsal = Session("rehearsal", scenario)
    rehearsal.join("nobody", "full")
    rehearsal.start()
    rehearsal.observe()
    rehearsal.advance(1)
    rehearsal.race_control.show_flag(Flag.YELLOW)
    rehearsal.race_control.penalise(0, 1.0)
    rehearsal.race_control.penalise(0, -1.0)
    rehearsal.race_control.penalise_late(0, 1.0)
    rehearsal.place_karts(np.zeros((1, len(PLACEMENT))))
    rehearsal.leave(0)


def _let_decide(name: str, scenario: Scenario) -> None:
    # Without a countdown: what a driver does once the lights are out is compiled too.
    rules = replace(scenario.rules, countdown_s=0.0)
    alone = Session("rehearsal", replace(scenario, karts=1, rules=rules))
    local_drivers = LocalDrivers(alone)
    driver = driver_named(name)
    local_drivers.admit(name, driver, 0)
    alone.start()
    if parks_after_race(alone.world) and isinstance(driver, ParkingDriver):
        alone.race_control.park(0)  # it parks after a race, and is here asked before
        local_drivers.park(0)
    alone.observe()
    local_drivers.answer(0)


@contextmanager
def no_garbage_collected() -> Iterator[None]:
    """Let no tick wait for the garbage collector."""
    gc.collect()
    gc.disable()
    try:
        yield
    finally:
        gc.enable()
