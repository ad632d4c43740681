"""Drives a vehicle to where its costs to go are least: what it does depends on its state alone.

So the answer is the same whichever way the vehicle came, and nearly the same a centimetre on. Those
of a planner are not: of two paths that cost about the same it finds one here and the other a metre
on.
"""

import math
from typing import NamedTuple

from race_agents.planning.rig_moves import DOCKED, way_in
from race_server.core.free_space.obstacles import Obstacles
from race_server.core.free_space.rig import Rig, Towed, is_towing
from race_server.core.free_space.states import (
    AHEAD,
    BACK,
    UNKNOWN,
    StateCosts,
    cost_to_go,
    is_among,
    state_after,
)
from race_server.core.kernels.boxes import hull_of
from race_server.core.kernels.geometry import Pose, clip, cos_sin, seen_from
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.trailers import axle_pose, hitch_angle
from race_server.core.rules.parking import judged_box, stand_of, turned_half
from race_server.core.state import Floats, Ints, Record, Records

# What is tried: shares of the greatest rate at which the angle changes, the most strides, and how
# long one is, as a share of a cell.
SHARES, TRIED, STRIDE = (0.0, 0.5, -0.5, 1.0, -1.0), 4, 0.5
# Strides that are looked ahead to where the vehicle turns round or stands, and the way [m] for the
# usual bar in which the wheels come to where they are steered to.
AHEAD_OF_IT = 12
STEERED = 0.75
# Speed at which it turns round, the most of a car [m/s], and braking [m/s²].
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


class Guide(NamedTuple):
    """What is known on the way to a slot."""

    costs: StateCosts  # around the slot
    far: StateCosts  # over all of a lot, by coarser cells; where there are none, those around it
    obstacles: Obstacles
    rig: Rig
    goal: Pose  # of the last axle


class Lead(NamedTuple):
    """How to drive on."""

    speed: float  # [m/s] negative in reverse
    # [1/m] of the path of the rear axle that draws a trailer; [rad] that the front wheels of a
    # car are to have.
    turn: float


@kernel
def known_at(guide: Guide, state: Towed) -> StateCosts:
    """Return the costs that say most of a state."""
    return guide.costs if is_among(guide.costs, guide.goal, state) else guide.far


@kernel
def cost_from(guide: Guide, state: Towed, gear: int) -> float:
    """Return the cost to go [m] of a state that drives on AHEAD or BACK, UNKNOWN without a way."""
    cost = cost_to_go(known_at(guide, state), guide.goal, state, gear)
    return cost if cost < UNKNOWN else cost_to_go(guide.far, guide.goal, state, gear)


@large_kernel
def choose(guide: Guide, state: Towed, gear: int) -> Choice:
    """Return what costs least. gear: AHEAD or BACK, in which the vehicle came."""
    found, rig = known_at(guide, state), guide.rig
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
                on = cost_from(guide, after, chosen)
                on = min(on, cost_from(guide, after, 1 - chosen) + found.cusp)
                cost = on + stride * count + turning
                if cost < best.cost:
                    best = Choice(chosen, share, cost)
    return best


@kernel
def _pace(left: float, top: float) -> float:
    """Return the speed [m/s] at which a vehicle can turn round or stand after a way [m]."""
    return min(math.sqrt(SLOW * SLOW + 2.0 * BRAKING * max(left, 0.0)), top)


@large_kernel
def lead(guide: Guide, state: Towed, gear: int, top: float, rows: Floats) -> Lead:
    """Return how to drive on from a state, at a speed from which it can turn round where it has to.

    Both are not numbers where no way is known.

    gear: AHEAD or BACK, in which the vehicle came; top: most speed [m/s]; rows: work space, see
    `way_in`.
    """
    found, rig = known_at(guide, state), guide.rig
    first = choice = choose(guide, state, gear)
    if is_towing(rig):
        left = abs(way_in(guide.obstacles, rig, state, guide.goal, DOCKED, -1.0, rows))
        if left + (found.cusp if gear == AHEAD else 0.0) <= first.cost:
            return Lead(-_pace(left, top), rows[0, 0])
    if first.cost >= UNKNOWN:
        return Lead(math.nan, math.nan)
    stride = STRIDE * found.grid.cell
    way = 1.0 if first.gear == AHEAD else -1.0
    after, turn, left = state, state.angle, 0.0
    for strides in range(1, AHEAD_OF_IT + 1):
        after = state_after(found, rig, after, choice.share, way * stride)
        if strides == 1 or strides * stride <= STEERED * found.scale:
            turn = after.curvature if is_towing(rig) else after.angle
        before = choice.cost
        choice = choose(guide, after, first.gear)
        if choice.cost > before or choice.gear != first.gear:
            break  # nothing is gained by going on
        left = stride * strides
    return Lead(way * _pace(left, top), turn)


@kernel
def is_settled(parker: Record, vehicle: Record, body: Record, share: float) -> bool:
    """Return whether a body stands well enough in its slot.

    parker: PARKER; vehicle: VEHICLE; body: BODY; share: see SETTLED.
    """
    number = judged_box(parker, vehicle)
    stand = stand_of(parker, vehicle, body, number)
    along = parker.along if parker.along > 0.0 else parker.within
    across = parker.across if parker.across > 0.0 else parker.within
    if parker.fits:
        half_along, half_across = turned_half(hull_of(vehicle, body, number), stand.turn)
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
    guide: Guide,
    rows: Floats,
    controls: Floats,
) -> None:
    """Fill `controls`, (W, 2) speed [m/s] and steering as a share, for the chosen worlds, (n,).

    Both are not numbers where no way is known.

    bodies, vehicles, parkers: (W, 1) BODY, VEHICLE and PARKER; goals: (W, 3) pose of the last axle
    in its place; rows: work space, see `way_in`.
    """
    for w in chosen:
        body, vehicle, parker = bodies[w, 0], vehicles[w, 0], parkers[w, 0]
        goal = Pose(goals[w, 0], goals[w, 1], goals[w, 2])
        state = _state_of(body, vehicle, goal, guide)
        gear = BACK if parker.gear < 0 else AHEAD
        top = vehicle.top_speed if is_towing(guide.rig) else TOP
        told = lead(guide, state, gear, top, rows)
        angle = told.turn
        if is_towing(guide.rig):
            angle = math.atan((vehicle.front_axle + vehicle.rear_axle) * told.turn)
        # On the way STEERED the wheels have to come there.
        late = max(abs(angle - body.steering), LITTLE) / vehicle.steering_rate
        most = max(STEERED * guide.costs.scale / late, SLOW)
        speed = clip(told.speed, -min(most, vehicle.reverse_speed), min(most, vehicle.top_speed))
        turns_round = (told.speed < 0.0) != (gear == BACK)
        if is_settled(parker, vehicle, body, KEPT if turns_round else SETTLED):
            speed = 0.0
        is_known = told.speed == told.speed
        controls[w, 0] = speed if is_known else math.nan
        controls[w, 1] = clip(angle / vehicle.steering_limit, -1.0, 1.0) if is_known else math.nan


@kernel
def _state_of(body: Record, vehicle: Record, goal: Pose, guide: Guide) -> Towed:
    """Return the state of a body as if its own goal were that of the guide."""
    towing = is_towing(guide.rig)
    seen = seen_from(goal, axle_pose(body, vehicle, 1 if towing else 0))
    angle, aside = hitch_angle(body, 0) if towing else body.steering, seen.y
    if not towing:
        angle = clip(angle, -guide.costs.sharpest, guide.costs.sharpest)
        aside += clip(seen.y, -BESIDE, BESIDE)
    cos, sin = cos_sin(guide.goal.heading)
    x = guide.goal.x + seen.x * cos - aside * sin
    y = guide.goal.y + seen.x * sin + aside * cos
    # The wheels may turn at a stand: what is asked of them is slow enough.
    return Towed(x, y, guide.goal.heading + seen.heading, angle, math.inf)
