"""How late a kart's commands act, told from its own wheels: what was asked of them, what they did.

No setting says it and nothing is measured beside the track: of several delays the one is believed
under which the last commands explain how the wheels turned. That holds for an answer that is held
back, for a slow link and, roughly, for an actuator that lags behind.
"""

from race_server.core.kernel_driver import DECISION, LATELY, Cockpit
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.observation import PART_NUMBERS
from race_server.core.state import Floats

STEERING = PART_NUMBERS["steering"]

# Delays are counted in thirds of a decision: a tick, where a driver decides every third one.
THIRDS = 3
# The longest delay considered [decisions].
LONGEST = 4
DELAYS = LONGEST * THIRDS + 1
# Share of what spoke against a delay that still does so one decision later.
FADING = 0.97
# So much less [rad²] must speak against another delay before it is believed instead, and this
# share of what speaks against the one believed.
EVIDENCE, SHARE = 1e-4, 0.5

# Places in a driver's memory: the latency, how the wheels stood; the last commands, newest first,
# each steering, throttle, brake; what spoke against each delay.
LATENCY = LATELY
WHEELS = LATELY + 1
COMMANDS = LATELY + 2
COMMAND = 3
AGAINST = COMMANDS + (LONGEST + 1) * COMMAND


@kernel
def age_at(third: int, delay: int) -> int:
    """Return which command acts `third` thirds after the newest one was given, 0 for the newest.

    delay: [thirds] from giving a command to its effect.
    """
    return (max(delay - third, 0) + THIRDS - 1) // THIRDS


@kernel
def remember_command(memory: Floats, control: Floats) -> None:
    """Keep what is commanded now, and forget the oldest command."""
    for index in range(LONGEST * COMMAND):
        to = COMMANDS + (LONGEST + 1) * COMMAND - 1 - index
        memory[to] = memory[to - COMMAND]
    for index in range(COMMAND):
        memory[COMMANDS + index] = control[index]


@large_kernel
def estimate_latency(cockpit: Cockpit) -> None:
    """Compare how the wheels turned since the last decision with what each delay would explain."""
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, setup, memory = cockpit.vehicle, cockpit.setup, cockpit.memory
    turn = vehicle.steering_rate * setup[DECISION] / THIRDS
    now, best = observation[offsets[STEERING]], 0
    for delay in range(DELAYS):
        angle = memory[WHEELS]
        for third in range(THIRDS):
            command = memory[COMMANDS + COMMAND * age_at(third, delay)]
            angle += min(max(command * vehicle.steering_limit - angle, -turn), turn)
        place = AGAINST + delay
        memory[place] = FADING * memory[place] + (angle - now) * (angle - now)
        if memory[place] < memory[AGAINST + best]:
            best = delay
    memory[WHEELS] = now
    believed = memory[AGAINST + int(memory[LATENCY])]
    if memory[AGAINST + best] < SHARE * believed - EVIDENCE:
        memory[LATENCY] = best
