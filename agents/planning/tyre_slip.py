"""Slip of both axles in a bend: what the tyre model says, and how much of it is seen.

Slip follows from force by the inverse of Fiala's brush tyre. Wheels that hold better than the model
thinks, or that roll without any slip, would steer too far with it: what is seen decides.
"""

import math

from race_agents.planning.latency import SLIP_MODEL, SLIP_SEEN, STEERING
from race_agents.planning.tactics import SPEED
from race_server.core.kernel_driver import Cockpit
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.observation import PART_NUMBERS
from race_server.core.state import Floats, Record
from race_server.core.vehicles import GRAVITY

LATERAL_SPEED = PART_NUMBERS["lateral_speed"]
YAW_RATE = PART_NUMBERS["yaw_rate"]
GRIP_SCALE = PART_NUMBERS["grip_scale"]

# Share of what was seen that is kept from one decision to the next.
FADING = 0.99
# What speaks for the model before anything is seen: a sum of squared slips [rad²].
PRIOR = 0.05
# The model is taken at its word down to this share of its slip: bends begin and end meanwhile.
ENOUGH = 0.7


@kernel
def grip_of(cockpit: Cockpit) -> float:
    """Return the most acceleration [m/s²] that the tyres give here."""
    observation, offsets, vehicle = cockpit.observation, cockpit.offsets, cockpit.vehicle
    return vehicle.grip * GRAVITY * max(observation[offsets[GRIP_SCALE]], 0.05)


@kernel
def slide_of(vehicle: Record, grip: float) -> float:
    """Return the slip at which the whole contact patch of a tyre slides. grip: [m/s²]."""
    return 3.0 * grip / GRAVITY / vehicle.cornering


@kernel
def tyre_slip(used: float, slide: float) -> float:
    """Return the slip of a brush tyre at a share of its most lateral force.

    slide: the slip at which the whole contact patch slides.
    """
    return slide * (1.0 - (1.0 - min(used, 0.97)) ** (1.0 / 3.0))


@kernel
def tyre_effort(slip: float, slide: float) -> float:
    """Return the share of its lateral force that a brush tyre gives at a slip; 1: it slides."""
    held = max(1.0 - abs(slip) / slide, 0.0)
    return 1.0 - held * held * held


@kernel
def axle_left(along: float) -> float:
    """Return the share of an axle's grip that is left across, with a share in use along."""
    return math.sqrt(max(1.0 - along * along, 0.05))


@large_kernel
def model_slips(
    vehicle: Record, grip: float, speed: float, bend: float, force: float
) -> tuple[float, float]:
    """Return the slip [rad] of front and rear axle in a bend [1/m], positive in a left one.

    vehicle: VEHICLE; grip: [m/s²]; speed: [m/s]; force: [N] of motor or brakes, which takes its
    part of the grip first.
    """
    wheelbase = vehicle.front_axle + vehicle.rear_axle
    along = abs(force) / (vehicle.mass * grip)
    front_share = vehicle.front_drive if force > 0.0 else vehicle.front_brake
    front_left = axle_left(along * front_share * wheelbase / vehicle.rear_axle)
    rear_left = axle_left(along * (1.0 - front_share) * wheelbase / vehicle.front_axle)
    slide = slide_of(vehicle, grip)
    used = speed * speed * abs(bend) / grip
    blend = (speed - vehicle.kinematic_below) / (vehicle.dynamic_above - vehicle.kinematic_below)
    side = min(max(blend, 0.0), 1.0) * (1.0 if bend >= 0.0 else -1.0)
    front = side * tyre_slip(used / front_left, slide * front_left)
    return front, side * tyre_slip(used / rear_left, slide * rear_left)


@kernel
def rear_slip(cockpit: Cockpit, speed: float) -> float:
    """Return the slip [rad] of the rear axle as it is observed now, positive in a left bend."""
    observation, offsets = cockpit.observation, cockpit.offsets
    turning, across = observation[offsets[YAW_RATE]], observation[offsets[LATERAL_SPEED]]
    return math.atan2(cockpit.vehicle.rear_axle * turning - across, speed)


@kernel
def rear_effort(cockpit: Cockpit, speed: float) -> float:
    """Return the share of their grip that the rear tyres use across, by the slip that is seen."""
    return tyre_effort(rear_slip(cockpit, speed), slide_of(cockpit.vehicle, grip_of(cockpit)))


@kernel
def watch_slip(cockpit: Cockpit) -> None:
    """Compare the slip of both axles with that of the model, as they are observed now."""
    observation, offsets = cockpit.observation, cockpit.offsets
    vehicle, memory = cockpit.vehicle, cockpit.memory
    speed = observation[offsets[SPEED]]
    if speed < vehicle.dynamic_above:
        return
    turning, across = observation[offsets[YAW_RATE]], observation[offsets[LATERAL_SPEED]]
    front, rear = model_slips(vehicle, grip_of(cockpit), speed, turning / speed, 0.0)
    seen_front = observation[offsets[STEERING]] - math.atan2(
        across + vehicle.front_axle * turning, speed
    )
    seen_rear = rear_slip(cockpit, speed)
    memory[SLIP_SEEN] = FADING * memory[SLIP_SEEN] + front * seen_front + rear * seen_rear
    memory[SLIP_MODEL] = FADING * memory[SLIP_MODEL] + front * front + rear * rear


@kernel
def slip_share(memory: Floats) -> float:
    """Return the share of the model's slip that is seen, at most 1. memory: (M,) of the driver."""
    share = (PRIOR + memory[SLIP_SEEN]) / (PRIOR + memory[SLIP_MODEL])
    return min(max(share / ENOUGH, 0.0), 1.0)


@kernel
def slips_in(cockpit: Cockpit, speed: float, bend: float, force: float) -> tuple[float, float]:
    """Return the slip [rad] to expect of front and rear axle: arguments as of `model_slips`."""
    share = slip_share(cockpit.memory)
    front, rear = model_slips(cockpit.vehicle, grip_of(cockpit), speed, bend, force)
    return share * front, share * rear
