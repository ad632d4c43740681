"""The failsafe of a kart whose driver is silent: it coasts, brakes, and stands safely.

A driver that speaks again drives on at once, with the place, laps and penalties that its kart has;
one that is away or silent for `AWAY_TICKS` has withdrawn.
"""

from enum import IntEnum

from race_server.core.clock import TICKS_PER_SECOND, ticks_of
from race_server.core.messages import Control

# The last control acts for this long, as if it had been sent again.
FRESH_TICKS = ticks_of(0.25)
# Then the motor is off and the wheels stay where they were: a gap of the network costs no crash.
COAST_TICKS = ticks_of(0.5)
# Then the kart brakes so gently that the wheels still steer …
BRAKE_TICKS = ticks_of(1.5)
BRAKE = 0.5
# … and at last it stands, wheels straight and brake on, until its driver has withdrawn.
AWAY_TICKS = ticks_of(10.0)
# All of this comes later to a slow kart: as long as it drives no further than its own length
# without a control there is nothing to brake for, up to this much longer.
SLOW_TICKS = ticks_of(0.75)

STOP = Control(brake=1.0)


class FailsafeStage(IntEnum):
    """The stage of a kart since the last control of its driver."""

    FRESH = 0
    COASTING = 1
    BRAKING = 2
    STOPPED = 3


def grace_of(speed: float, length: float) -> int:
    """Return how many ticks more a kart may go on at a speed [m/s]. length: its own [m]."""
    alone = TICKS_PER_SECOND * length / max(abs(speed), 1e-3)
    return min(max(round(alone) - FRESH_TICKS, 0), SLOW_TICKS)


def failsafe_stage(ticks: int, *, is_linked: bool) -> FailsafeStage:
    """Return how far a kart is `ticks` after its driver's last control was due.

    is_linked: whether the driver's link is there. Where it has gone nothing can come, so the kart
    brakes at once.
    """
    if ticks > BRAKE_TICKS:
        return FailsafeStage.STOPPED
    if ticks > COAST_TICKS or not is_linked:
        return FailsafeStage.BRAKING
    return FailsafeStage.COASTING if ticks > FRESH_TICKS else FailsafeStage.FRESH


def control_under(silence: FailsafeStage, last: Control) -> Control:
    """Return what acts on a kart in place of its driver's last control."""
    if silence is FailsafeStage.FRESH:
        return last
    if silence is FailsafeStage.COASTING:
        return Control(steering=last.steering)
    if silence is FailsafeStage.BRAKING:
        return Control(steering=last.steering, brake=BRAKE)
    return STOP
