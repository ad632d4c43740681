"""What acts on the karts of a session: their drivers' controls, or the failsafe."""

import numpy as np

from race_server.core.driven import are_driven
from race_server.core.messages import Button, Control
from race_server.core.state import Float32s, Floats, World
from race_server.scenario.race import Scenario
from race_server.session.failsafe import (
    STOP,
    FailsafeStage,
    control_under,
    failsafe_stage,
    grace_of,
)
from race_server.session.journal_entries import Inputs
from race_server.session.seats import Seat, Seats


class Controls:
    """The controls that act on all karts of one race."""

    def __init__(self, scenario: Scenario, decision_ticks: int) -> None:
        """Hold every kart still."""
        self.acting: Floats = np.zeros((1, scenario.karts, 4))
        self._loaded: Float32s = np.zeros((scenario.karts, 4), np.float32)
        self._lengths = [scenario.vehicle_of(seat).length for seat in range(scenario.karts)]
        self._decision_ticks = decision_ticks

    def clear(self) -> None:
        """Begin a race: no control was received yet."""
        self.acting[:] = 0.0
        self._loaded[:] = 0.0

    def load(self, seats: Seats, world: World) -> Inputs | None:
        """Apply the newest control of each seat, and return those that changed."""
        tick = int(world.races[0].tick)
        # All at once: to ask a record for a field takes a microsecond.
        racing = are_driven(world).tolist()
        speeds = world.bodies["speed"][0].tolist()
        for seat in seats.taken():
            is_racing = racing[seat.number]
            self._update_failsafe(seat, tick, speeds[seat.number], is_racing=is_racing)
            control = _control_of(seat, is_racing=is_racing)
            buttons = control.buttons | (Button.USE_ITEM if seat.uses_item else Button.NONE)
            seat.uses_item = False
            # As on the wire, so that a recording holds exactly what acted.
            self._loaded[seat.number] = (
                control.steering,
                control.throttle,
                control.brake,
                int(buttons),
            )
        changed = np.flatnonzero((self._loaded != self.acting[0]).any(axis=1))
        if not len(changed):
            return None
        self.acting[0] = self._loaded
        sequences = np.array([seats[int(number)].sequence for number in changed])
        return Inputs(tick, changed, self._loaded[changed], sequences)

    def recall(self, inputs: Inputs) -> None:
        """Apply the controls of a recording."""
        self.acting[0, inputs.seats] = inputs.controls

    def _update_failsafe(self, seat: Seat, tick: int, speed: float, *, is_racing: bool) -> None:
        """Update the failsafe stage of a seat."""
        # A control that came after a link was gone shows that the driver is there.
        is_linked = seat.is_present or seat.control_tick > seat.away_since
        has_spoken = seat.control_tick >= 0
        overdue = tick - seat.control_tick - self._decision_ticks
        grace = grace_of(speed, self._lengths[seat.number]) if has_spoken else 0
        silence = failsafe_stage(overdue - grace, is_linked=is_linked)
        # A kart that slows down without controls must not get its grace again, and drive off.
        seat.silence = silence if overdue <= 0 and is_linked else max(seat.silence, silence)
        hangs = is_racing and seat.silence is FailsafeStage.STOPPED and has_spoken
        # The trackers know more of real karts.
        if hangs and not seat.is_tracked and seat.away_since < 0:
            seat.away_since = tick  # its link is there, but it answers no more


def _control_of(seat: Seat, *, is_racing: bool) -> Control:
    """Return what acts on the kart of a seat."""
    # No tick waits for the controls of a kart that has finished: they must not matter.
    if not is_racing:
        return STOP
    if seat.is_tracked and seat.silence is not FailsafeStage.FRESH:
        return STOP  # it moves by its poses: there is nothing to let coast
    return control_under(seat.silence, seat.control)
