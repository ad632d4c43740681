"""Tactics that all drivers here share: when to use an item, how to get free when stuck."""

from race_server.core import codes
from race_server.core.kernel_driver import (
    ATTEMPTS,
    DECISION,
    ESCAPE,
    PRESSED,
    REVERSING,
    STANDING,
    URGE,
    URGENT,
    Cockpit,
)
from race_server.core.kernels.jit import kernel
from race_server.core.observation import NEARBY, PART_NUMBERS
from race_server.core.state import Floats

SPEED = PART_NUMBERS["speed"]
KARTS_X = PART_NUMBERS["karts_x"]
ITEM = PART_NUMBERS["item"]
LIGHTS = PART_NUMBERS["lights"]
FLAG = PART_NUMBERS["flag"]
RANK = PART_NUMBERS["rank"]
WRONG_WAY = PART_NUMBERS["wrong_way"]
RESCUE_OFFERED = PART_NUMBERS["rescue_offered"]
FINISHED = PART_NUMBERS["finished"]

# A kart that should drive and moves slower than this [m/s] is not getting anywhere.
STANDSTILL = 0.15
PATIENCE_S = 0.6
# Attempts to get free are forgotten once it has driven for this time [s]. Each makes it back out
# farther, up to this number.
FORGOTTEN_S, MOST_ATTEMPTS = 4.0, 8.0


@kernel
def finish_decision(cockpit: Cockpit) -> None:
    """Add buttons to what a driver wants to do, or replace it by the way out of a jam."""
    observation, offsets = cockpit.observation, cockpit.offsets
    memory, control = cockpit.memory, cockpit.control
    control[3] = 0.0
    if observation[offsets[LIGHTS]] > 0.0 or observation[offsets[FINISHED]] > 0.0:
        _stand(control)
        return
    # A button acts when it is pressed, so it is released after each press.
    pressed = memory[PRESSED] == 0.0 and _is_used(cockpit)
    memory[PRESSED] = 1.0 if pressed else 0.0
    buttons = codes.USE_ITEM if pressed else 0
    if observation[offsets[RESCUE_OFFERED]] > 0.0:
        buttons |= codes.ACCEPT_RESCUE
    if observation[offsets[WRONG_WAY]] > 0.0:
        # Turned round in a crowd: to stand still is the way to be put back on the line.
        _stand(control)
    else:
        escape(cockpit)
    control[3] = buttons


@kernel
def _stand(control: Floats) -> None:
    control[0] = 0.0
    control[1] = 0.0
    control[2] = 1.0


@kernel
def _is_used(cockpit: Cockpit) -> bool:
    """Return whether to use the item held: as advised, or else as the driver sees it."""
    observation, offsets, memory = cockpit.observation, cockpit.offsets, cockpit.memory
    if abs(memory[URGE]) > URGENT:
        return bool(memory[URGE] > 0.0 and observation[offsets[ITEM]] > 0.5)
    return wants_item(cockpit)


@kernel
def wants_item(cockpit: Cockpit) -> bool:
    """Return whether now is the time to use the item held."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    item_uses, control = cockpit.item_uses, cockpit.control
    number = int(observation[offsets[ITEM]] + 0.5)
    if number <= 0:
        return False
    kind = item_uses[number] if number < len(item_uses) else 0
    if kind == codes.ON_SELF:
        return abs(control[0]) < 0.35 and control[1] > 0.5
    if kind == codes.ON_KART_AHEAD:
        return observation[offsets[RANK]] > 1.5
    if kind == codes.PLACED:
        return observation[offsets[SPEED]] > 1.0 and _is_followed(cockpit, 8.0 * vehicle.length)
    return True


@kernel
def _is_followed(cockpit: Cockpit, near: float) -> bool:
    """Return whether a kart is within `near` [m] behind; True where the preset has no karts."""
    observation, offsets = cockpit.observation, cockpit.offsets
    start = offsets[KARTS_X]
    if start < 0:
        return True
    for index in range(NEARBY):
        if -near < observation[start + index] < 0.0:
            return True
    return False


@kernel
def escape(cockpit: Cockpit) -> None:
    """Back out of a jam with the wheels turned the other way; longer each time it did not help."""
    observation, offsets = cockpit.observation, cockpit.offsets
    setup, memory, control = cockpit.setup, cockpit.memory, cockpit.control
    step, speed = setup[DECISION], observation[offsets[SPEED]]
    if memory[REVERSING] > 0.0:
        memory[REVERSING] -= step
        control[0] = memory[ESCAPE]
        control[1] = -1.0
        control[2] = 0.0
        return
    held = observation[offsets[FLAG]] > 1.5
    if abs(speed) > STANDSTILL or held:
        driven = min(memory[STANDING], 0.0)
        memory[STANDING] = driven - step if speed > 1.0 else 0.0
        if driven < -FORGOTTEN_S:
            memory[ATTEMPTS] = 0.0
        return
    memory[STANDING] = max(memory[STANDING], 0.0) + step
    if memory[STANDING] > PATIENCE_S:
        memory[ATTEMPTS] += 1.0
        memory[STANDING] = 0.0
        memory[REVERSING] = 0.4 + 0.2 * min(memory[ATTEMPTS], MOST_ATTEMPTS)
        memory[ESCAPE] = -1.0 if control[0] >= 0.0 else 1.0
        if memory[ATTEMPTS] % 3.0 == 0.0:
            memory[ESCAPE] = 0.0


@kernel
def press_pedals(speed: float, target: float, gain: float, control: Floats) -> None:
    """Set throttle and brake to bring `speed` to `target` [m/s].

    gain: share of full throttle per m/s; control: (4,), see `Cockpit`.
    """
    error = gain * (target - speed)
    control[1] = min(max(error, 0.0), 1.0)
    control[2] = min(max(-0.5 * error, 0.0), 1.0)
