"""What a driver on the line remembers of the course: where it came too near to a border, or slid.

No model says all that a kart does at its limit. Where it came that near by itself, or its rear axle
lost its hold, it is slower on the way there from then on, and slower still where it does so again.
"""

import math

from race_agents.planning.clearance import reach_aside
from race_agents.planning.tactics import SPEED
from race_agents.planning.tracking import HEADING
from race_agents.planning.traffic import LEFT, LIGHTS, OFFSET, RIGHT, STEP, is_alone
from race_agents.planning.tyre_slip import GRIP_SCALE, rear_slip
from race_server.core.kernel_driver import KEPT, Cockpit
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.observation import AHEAD, PART_NUMBERS

PROGRESS = PART_NUMBERS["progress"]
LINE_SPEED = PART_NUMBERS["line_speed_ahead"]

# Stretches of the course, and how many lengths of the vehicle each has. A longer course begins
# again with the first. Drivers on the line keep no scan: its place in their memory is free.
STRETCHES, STRETCH_LENGTHS = 128, 4.0
LESS = KEPT
# Whether the kart failed at the last decision, and the longest progress seen [m].
HAD_FAILED, LONGEST = KEPT + STRETCHES, KEPT + STRETCHES + 1

# Nearer to a border than this [body widths] is too near.
NEAR = 0.05
# A rear axle that slips more than this [rad] has lost its hold: the body turns round.
SLID = 0.35
# By which share of its speed a kart is slower from then on, after a slide, and at most; and on
# which way: that of these seconds before.
LESS_SPEED, LESS_AFTER_SLIDE, MOST_LESS, BEFORE_S = 0.03, 0.06, 0.12, 1.2
# A kart within this many lengths may have pushed it; one that is slower than this [m/s], or whose
# tyres have less than this share of their grip, has other troubles.
PUSHED_LENGTHS, MOVING, GRIPPING = 2.5, 1.0, 0.99


@large_kernel
def take_care(cockpit: Cockpit) -> None:
    """Make the line slower where the kart failed before, and remember where it fails now."""
    observation, offsets, memory = cockpit.observation, cockpit.offsets, cockpit.memory
    progress = observation[offsets[PROGRESS]]
    memory[LONGEST] = max(memory[LONGEST], progress)
    near = border_distance(cockpit) < NEAR * cockpit.vehicle.width
    slid = abs(rear_slip(cockpit, max(observation[offsets[SPEED]], MOVING))) > SLID
    failed = (near or slid) and drives_alone(cockpit)
    if failed and memory[HAD_FAILED] == 0.0:
        remember(cockpit, progress, LESS_AFTER_SLIDE if slid else LESS_SPEED)
    memory[HAD_FAILED] = 1.0 if failed else 0.0
    for index in range(AHEAD):
        less = less_speed(cockpit, progress + index * observation[offsets[STEP]])
        observation[offsets[LINE_SPEED] + index] *= 1.0 - less


@kernel
def border_distance(cockpit: Cockpit) -> float:
    """Return the room [m] between the body and the nearer border beside it."""
    observation, offsets = cockpit.observation, cockpit.offsets
    to_left, to_right = reach_aside(cockpit.vehicle, math.sin(observation[offsets[HEADING]]))
    left = observation[offsets[LEFT]] - observation[offsets[OFFSET]] - to_left
    right = observation[offsets[RIGHT]] + observation[offsets[OFFSET]] - to_right
    return min(left, right)


@kernel
def drives_alone(cockpit: Cockpit) -> bool:
    """Return whether a kart moves on all of its grip and no other one can have pushed it."""
    observation, offsets = cockpit.observation, cockpit.offsets
    if observation[offsets[LIGHTS]] > 0.0 or observation[offsets[SPEED]] < MOVING:
        return False
    if observation[offsets[GRIP_SCALE]] < GRIPPING:
        return False
    return is_alone(cockpit, PUSHED_LENGTHS)


@kernel
def remember(cockpit: Cockpit, progress: float, less: float) -> None:
    """Be slower by a share from now on along the way to a place. progress: of that place [m]."""
    memory, stretch = cockpit.memory, STRETCH_LENGTHS * cockpit.vehicle.length
    way = BEFORE_S * cockpit.observation[cockpit.offsets[SPEED]]
    for back in range(min(int(way / stretch) + 2, STRETCHES)):
        place = LESS + stretch_at(cockpit, progress - back * stretch)
        memory[place] = min(memory[place] + less, MOST_LESS)


@kernel
def stretch_at(cockpit: Cockpit, progress: float) -> int:
    """Return the stretch at a progress [m], which may be of the lap before or after."""
    longest, stretch = cockpit.memory[LONGEST], STRETCH_LENGTHS * cockpit.vehicle.length
    if longest > 0.0:
        progress %= longest + stretch * 1e-3
    return int(max(progress, 0.0) / stretch) % STRETCHES


@kernel
def less_speed(cockpit: Cockpit, progress: float) -> float:
    """Return the share of its speed by which the kart is slower at a progress [m]."""
    stretch = STRETCH_LENGTHS * cockpit.vehicle.length
    here = cockpit.memory[LESS + stretch_at(cockpit, progress)]
    after = cockpit.memory[LESS + stretch_at(cockpit, progress + stretch)]
    share = progress / stretch - math.floor(progress / stretch)
    return here + share * (after - here)
