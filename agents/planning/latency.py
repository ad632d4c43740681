"""Estimate how late a kart's commands act, from the steering commanded and the steering observed.

No setting gives the latency. Of several delays the estimate is the one under which the last
commands explain best how the wheels turned. This covers answers that are delayed on purpose, slow
links and, roughly, actuators that lag. What no delay explains is play in the steering.
"""

import math

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
# Share of the squared error of a delay that is kept from one decision to the next.
FADING = 0.97
# Another delay replaces the estimate once its squared error is below `SHARE` of that of the
# estimate, less `EVIDENCE` [rad²].
EVIDENCE, SHARE = 1e-4, 0.5

# Places in a driver's memory: the latency, the steering angle at the last decision; the last
# commands, newest first, each steering, throttle, brake; the squared error of each delay.
LATENCY = LATELY
WHEELS = LATELY + 1
COMMANDS = LATELY + 2
COMMAND = 3
AGAINST = COMMANDS + (LONGEST + 1) * COMMAND
# Sums of the slip seen times that of the model, and of its square: see `tyre_slip.py`.
SLIP_SEEN, SLIP_MODEL = AGAINST + DELAYS, AGAINST + DELAYS + 1


# Play [rad] below this is none, and above that it is something else.
LEAST_PLAY, MOST_PLAY = 0.002, 0.03
# The play is taken up for changes of more than this share of it.
TAKEN_UP = 0.25


@kernel
def steering_play(memory: Floats) -> float:
    """Return how far [rad] the wheels were of late from where the commands should have put them.

    memory: (M,) of the driver. Play in the steering does that, and so do wheels that lag.
    """
    play = math.sqrt((1.0 - FADING) * memory[AGAINST + int(memory[LATENCY])])
    return min(play, MOST_PLAY) if play > LEAST_PLAY else 0.0


@kernel
def take_up_play(memory: Floats, angle: float, now: float) -> float:
    """Return the angle [rad] to command so that wheels with play turn to `angle` [rad].

    memory: (M,) of the driver; now: angle of the wheels [rad]. They stop that much before what is
    commanded.
    """
    play = steering_play(memory)
    if play == 0.0:
        return angle
    return angle + min(max((angle - now) / TAKEN_UP, -play), play)


@kernel
def age_at(third: int, delay: int) -> int:
    """Return which command acts `third` thirds after the newest one was given, 0 for the newest.

    delay: [thirds] from giving a command to its effect.
    """
    return (max(delay - third, 0) + THIRDS - 1) // THIRDS


@kernel
def remember_command(memory: Floats, control: Floats) -> None:
    """Store the present command and drop the oldest one. memory: (M,); control: (4,)."""
    for index in range(LONGEST * COMMAND):
        to = COMMANDS + (LONGEST + 1) * COMMAND - 1 - index
        memory[to] = memory[to - COMMAND]
    for index in range(COMMAND):
        memory[COMMANDS + index] = control[index]


@large_kernel
def estimate_latency(cockpit: Cockpit) -> None:
    """Compare the steering since the last decision with the one that each delay predicts."""
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
