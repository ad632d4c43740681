"""Follows the kart ahead by the Intelligent Driver Model, and overtakes when it gains by that."""

import math

from agents.tactics import SPEED, finish_decision
from agents.tracking import (
    OFFSET,
    acceleration_on_line,
    press_for,
    speed_on_line,
    steering_on_line,
)
from agents.traffic import (
    ABREAST,
    NOWHERE,
    lane_past,
    lane_past_hazards,
    leader,
    move_over,
    wait_in_line,
)
from race_server.autopilot import DECISION, SHIFT, Autopilot
from race_server.kernels.jit import kernel, large_kernel
from race_server.state import Floats, Ints, Record, Records

# The model's figures, for a race instead of a road: time gap [s], gap when standing in lengths,
# shares of motor and brakes that are comfortable.
TIME_GAP_S = 0.35
STANDING_GAP = 0.3
COMFORT = 0.6
# How many lengths ahead another kart is followed, or passed.
NEAR_LENGTHS, NEAR_S = 3.0, 1.5
# What an overtaking must bring [m/s].
GAIN = 0.3


@kernel
def follow_acceleration(
    speed: float,
    wanted: float,
    gap: float,
    approach: float,
    most: float,
    comfort: float,
    standing: float,
) -> float:
    """Return the acceleration [m/s²] of the Intelligent Driver Model behind another kart.

    a (1 - (v / v0)⁴ - (s* / s)²) with the wanted gap s* = s0 + max(0, v T + v dv / (2 √(a b))):
    Treiber, Hennecke and Helbing, Congested traffic states in empirical observations and
    microscopic simulations, Physical Review E 62, 1805 (2000). speed: v; wanted: v0, both [m/s];
    gap: s [m] between the bodies; approach: dv [m/s], how much slower the other is; most: a
    [m/s²] of the motor; comfort: b [m/s²] of the brakes; standing: s0 [m].
    """
    dynamic = speed * TIME_GAP_S + speed * approach / (2.0 * math.sqrt(most * comfort))
    distance = (standing + max(dynamic, 0.0)) / max(gap, 0.05 * standing)
    share = speed / max(wanted, 0.1)
    return most * (1.0 - share**4 - distance * distance)


@kernel
def follow(
    seen: Floats,
    at: Ints,
    vehicle: Record,
    gear: Floats,
    kinds: Ints,
    memory: Floats,
    control: Floats,
) -> None:
    """Follow the line behind a slower kart, or in a lane past it."""
    wanted = lane_to_gain(seen, at, vehicle, memory[SHIFT])
    wanted = lane_past_hazards(seen, at, vehicle, wanted)
    lane = move_over(seen, at, vehicle, memory[SHIFT], wanted, gear[DECISION])
    memory[SHIFT] = lane
    acceleration = acceleration_on_line(seen, at, vehicle, gear, lane)
    acceleration = min(acceleration, behind_leader(seen, at, vehicle))
    force = press_for(seen, at, vehicle, acceleration, control)
    control[0] = steering_on_line(seen, at, vehicle, lane, force)
    wait_in_line(seen, at, vehicle, gear, memory)
    finish_decision(seen, at, vehicle, gear, kinds, memory, control)


@large_kernel
def behind_leader(seen: Floats, at: Ints, vehicle: Record) -> float:
    """Return the model's acceleration [m/s²] behind the kart ahead, infinite if there is none."""
    gap, pace, _ = leader(seen, at, vehicle, seen[at[OFFSET]], 0.5 * vehicle.length)
    if gap == math.inf:
        return math.inf
    speed = max(seen[at[SPEED]], 0.0)
    most = COMFORT * vehicle.motor_force / vehicle.mass
    comfort = COMFORT * vehicle.brake_force / vehicle.mass
    wanted = 1.2 * vehicle.top_speed
    standing = STANDING_GAP * vehicle.length
    return follow_acceleration(speed, wanted, gap, speed - pace, most, comfort, standing)


@large_kernel
def lane_to_gain(seen: Floats, at: Ints, vehicle: Record, now: float) -> float:
    """Return the lane [m] left of the line to be in: the line itself, or past a slower kart."""
    gap, pace, across = leader(seen, at, vehicle, 0.0, 0.3 * vehicle.length)
    speed = seen[at[SPEED]]
    if gap > NEAR_LENGTHS * vehicle.length + NEAR_S * max(speed - pace, 0.0):
        return 0.0
    if speed_on_line(seen, at, vehicle, now, 0.0) < pace + GAIN:
        return 0.0
    apart, reach = ABREAST * vehicle.width, gap + vehicle.length
    past = lane_past(seen, at, vehicle, across, apart, reach, now)
    return 0.0 if past == NOWHERE else past


@kernel
def follow_all(
    seats: Ints,
    seen: Floats,
    at: Ints,
    vehicles: Records,
    gear: Floats,
    kinds: Ints,
    memory: Floats,
    controls: Floats,
) -> None:
    """Decide for many karts: row n of `seats` is a world and a kart in it."""
    for row in range(len(seats)):
        w, k = seats[row, 0], seats[row, 1]
        follow(seen[w, k], at, vehicles[w, k], gear, kinds, memory[w, k], controls[w, k])


class FollowAndPass(Autopilot):
    """Drives the reference line, follows a slower kart at a distance and passes it."""

    preset = "line"
    decide = staticmethod(follow)
    decide_all = staticmethod(follow_all)
