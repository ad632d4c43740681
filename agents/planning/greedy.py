"""Drives a car to where its costs to go are least: what it does depends on its state alone.

So the answer is the same whichever way the car came, and nearly the same a centimetre on. Those of
a planner are not: of two paths that cost about the same it finds one here and the other a metre on.
"""

import math
from typing import NamedTuple

from race_server.core.free_space.rig import Rig, Towed
from race_server.core.free_space.state_costs import (
    AHEAD,
    BACK,
    StateCosts,
    cost_to_go,
    state_after,
)
from race_server.core.kernels.boxes import Hull, hull_of
from race_server.core.kernels.geometry import Pose, clip, cos_sin, seen_from
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.trailers import axle_pose
from race_server.core.rules.parking import stand_in, turned_half
from race_server.core.state import Floats, Ints, Record, Records

# What is tried: shares of the greatest rate at which the angle changes, the most strides, and how
# long one is, as a share of a cell.
SHARES, TRIED, STRIDE = (0.0, 0.5, -0.5, 1.0, -1.0), 4, 0.5
# Strides that are looked ahead to where the vehicle turns round or stands, and those after which
# the angle is the one to steer to.
AHEAD_OF_IT, STEERED_TO = 12, 3
# Speed at which it turns round, the most [m/s], and braking [m/s²].
SLOW, TOP, BRAKING = 0.3, 1.0, 0.5
# A change of the wheels' angle [rad] that does not slow the vehicle down.
LITTLE = 0.06
# It stops where it is as near to its place as this share of what its level allows, and of the room
# that a body which has to lie inside a slot has there. Where it is as near as the other share, it
# does not turn round: a turn there gains less than the costs promise.
SETTLED, KEPT = 0.7, 0.95
# It takes itself for so much farther aside of its place [m] at most, up to twice as far: costs too
# high just at the place let it stop short of that, by most of a cell.
BESIDE = 0.06


class Choice(NamedTuple):
    """What to do in a state."""

    gear: int  # AHEAD or BACK
    share: float  # of the greatest rate at which the angle changes
    cost: float  # [m] from the state on


class Lead(NamedTuple):
    """How to drive on."""

    speed: float  # [m/s] negative in reverse
    angle: float  # [rad] that the front wheels are to have


@large_kernel
def choose(found: StateCosts, rig: Rig, goal: Pose, state: Towed, gear: int) -> Choice:
    """Return what costs least. gear: AHEAD or BACK, in which the vehicle came."""
    best = Choice(gear, 0.0, math.inf)
    stride = STRIDE * found.grid.cell
    for chosen in range(2):
        turning = found.cusp if chosen != gear else 0.0
        for share in SHARES:
            after = state
            for count in range(1, TRIED + 1):
                after = state_after(
                    found, rig, after, share, stride if chosen == AHEAD else -stride
                )
                on = cost_to_go(found, goal, after, chosen)
                on = min(on, cost_to_go(found, goal, after, 1 - chosen) + found.cusp)
                cost = on + stride * count + turning
                if cost < best.cost:
                    best = Choice(chosen, share, cost)
    return best


@large_kernel
def lead(found: StateCosts, rig: Rig, goal: Pose, state: Towed, gear: int, top: float) -> Lead:
    """Return how to drive on from a state, at a speed from which it can turn round where it has to.

    gear: AHEAD or BACK, in which the vehicle came; top: most speed [m/s].
    """
    first = choice = choose(found, rig, goal, state, gear)
    stride = STRIDE * found.grid.cell
    way = 1.0 if first.gear == AHEAD else -1.0
    after, angle, strides = state, state.angle, 0
    while strides < AHEAD_OF_IT and choice.gear == first.gear:
        after = state_after(found, rig, after, choice.share, way * stride)
        strides += 1
        if strides <= STEERED_TO:
            angle = after.angle
        before = choice.cost
        choice = choose(found, rig, goal, after, first.gear)
        if choice.cost > before:
            break  # nothing is gained by going on
    speed = math.sqrt(SLOW * SLOW + 2.0 * BRAKING * stride * max(strides - 1, 0))
    if strides == AHEAD_OF_IT:
        speed = top
    return Lead(way * min(speed, top), angle)


@kernel
def is_settled(parker: Record, hull: Hull, share: float) -> bool:
    """Return whether a body stands well enough in its slot. parker: PARKER; share: see SETTLED."""
    stand = stand_in(parker, hull)
    along = parker.along if parker.along > 0.0 else parker.within
    across = parker.across if parker.across > 0.0 else parker.within
    if parker.fits:
        half_along, half_across = turned_half(hull, stand.turn)
        along = min(along, 0.5 * parker.length - half_along)
        across = min(across, 0.5 * parker.width - half_across)
    is_near = abs(stand.along) < share * along and abs(stand.across) < share * across
    return bool(is_near and abs(stand.turn) < share * parker.turn)


@large_kernel
def lead_all(
    chosen: Ints,
    bodies: Records,
    vehicles: Records,
    parkers: Records,
    goals: Floats,
    found: StateCosts,
    rig: Rig,
    controls: Floats,
) -> None:
    """Fill `controls`, (W, 2) speed [m/s] and steering as a share, for the chosen worlds, (n,).

    bodies, vehicles, parkers: (W, 1) BODY, VEHICLE and PARKER; goals: (W, 3) pose of the rear axle
    in its place.
    """
    for w in chosen:
        body, vehicle, parker = bodies[w, 0], vehicles[w, 0], parkers[w, 0]
        goal = Pose(goals[w, 0], goals[w, 1], goals[w, 2])
        axle = axle_pose(body, vehicle, 0)
        angle = clip(body.steering, -found.sharpest, found.sharpest)
        beside = clip(seen_from(goal, axle).y, -BESIDE, BESIDE)
        cos, sin = cos_sin(goal.heading)
        x, y = axle.x - beside * sin, axle.y + beside * cos
        state = Towed(x, y, axle.heading, angle, 0.0)
        top = min(TOP, vehicle.top_speed, vehicle.reverse_speed)
        gear = BACK if parker.gear < 0 else AHEAD
        told = lead(found, rig, goal, state, gear, top)
        # In the time of STEERED_TO strides the wheels have to come there.
        late = max(abs(told.angle - body.steering), LITTLE) / vehicle.steering_rate
        most = max(STEERED_TO * STRIDE * found.grid.cell / late, SLOW)
        speed = clip(told.speed, -most, most)
        turns_round = (told.speed < 0.0) != (gear == BACK)
        if is_settled(parker, hull_of(vehicle, body, 0), KEPT if turns_round else SETTLED):
            speed = 0.0
        controls[w, 0] = speed
        controls[w, 1] = clip(told.angle / vehicle.steering_limit, -1.0, 1.0)
