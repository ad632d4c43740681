"""Reward terms of parking: their names, the tables that weigh them, and how they are measured."""

import math
from collections.abc import Mapping
from types import MappingProxyType

from race_server.core import codes
from race_server.core.kernels.jit import kernel
from race_server.core.messages import Ending
from race_server.core.rules.parking import (
    ALIGNED_WITHIN,
    Stand,
    ending_of,
    judged_box,
    stand_of,
)
from race_server.core.state import Record, World
from race_server.envs.buffers import Buffers
from race_server.envs.decision import close_episode, weigh_terms
from race_server.envs.parking.heuristics.aim import aim_of, goal_of, middle_of
from race_server.envs.parking.heuristics.euclid import straight_way
from race_server.envs.parking.heuristics.field import Field, chart_of
from race_server.envs.parking.heuristics.table import EUCLID, way_left

# What each term measures over one decision of one vehicle. The order is that of the numbers below;
# a test holds the two together. A share is the part of the time limit that a decision takes, so
# that what adds up over an episode does not depend on how long it may last.
TERMS: Mapping[str, str] = MappingProxyType(
    {
        "parked": "1 if the vehicle is parked now",
        "aligned": "1 if it is parked now, within 10° of its slot's heading, its last trailer if "
        "it has any",
        "misparked": "1 if it is parked now, further off",
        "crash": "1 if it ran into a wall, a block, a vehicle or a person and is out",
        "person": "1 if that was a person",
        "left": "1 if it is too far from its slot and out",
        "late": "1 if the time is up",
        "time": "share of the time limit",
        "reversing": "that share while the throttle is negative",
        "steering_wide": "that share while the wheels are turned by more than 15°",
        "standing": "that share while it stands",
        "goal_distance": "distance to the slot [m], times that share",
        "goal_progress": "metres gained towards the slot, by the heuristic of the task and in the "
        "way of its shaping",
        "goal_turn": "radians gained towards the slot's heading, the more the nearer: "
        "divided by 1 + the distance [m]",
        "steering_change": "change of the wanted steering, as a share of the limit",
        "jack_knife": "1 if a hitch was bent too far, or a trailer touched what draws it, and it "
        "is out",
        "goal_way": "metres that the heuristic says are left",
        "touch": "how often it ran into a wall, a block, a vehicle or a person, and goes on",
    }
)

_REPORT_A = {"parked": 1.0, "late": -1.0, "left": -1.0, "time": -1.0}
_REPORT_A_FINAL = {
    "parked": 1.0,
    "late": -1.0,
    "reversing": -1.0,
    "steering_wide": -1.0,
    "misparked": -1.0,
}
REWARDS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        # Report on automatic parking of a kart, 2022. Its first configuration; its second, whose
        # penalties of 0.001 a step are 0.6 of a minute of 600 steps; its final one, with the
        # penalty of the distance in metres, as a share of the 70 m of its yard, and without.
        "report_a_1": _REPORT_A,
        "report_a_2": {
            **_REPORT_A,
            "reversing": -0.6,
            "steering_wide": -0.6,
            "misparked": -0.5,
        },
        "report_a_distance": {**_REPORT_A_FINAL, "goal_distance": -1.0},
        "report_a_share": {**_REPORT_A_FINAL, "goal_distance": -1.0 / 70.0},
        "report_a": _REPORT_A_FINAL,
        # A crash costs more than what is left of all penalties, or crashing would pay.
        "park": {
            "parked": 1.0,
            "aligned": 1.0,
            "crash": -1.5,
            "left": -1.5,
            "late": -0.5,
            "time": -0.5,
            "goal_progress": 0.03,
            "goal_turn": 0.1,
            "jack_knife": -1.5,
        },
        # Report on an articulated vehicle that learns to park, with the distance as heuristic. Its
        # 0.1 a step for standing and 0.02 for a change of steering: the former as a share of 240 s
        # at 10 decisions a second, the latter for a change by the whole limit.
        "report_c": {
            "parked": 100.0,
            "aligned": 100.0,
            "crash": -100.0,
            "jack_knife": -100.0,
            "time": -20.0,
            "standing": -0.1 * 2400.0,
            "steering_change": -0.02,
            "goal_progress": 1.0,
        },
    }
)

PARKED, ALIGNED, MISPARKED, CRASH, PERSON, LEFT, LATE, TIME, REVERSING = range(9)
STEERING_WIDE, STANDING, GOAL_DISTANCE, GOAL_PROGRESS, GOAL_TURN, STEERING_CHANGE = range(9, 15)
JACK_KNIFE, GOAL_WAY, TOUCH = 15, 16, 17

# How the ways d before and d' after a decision become `goal_progress`, with the discount g: d - d';
# the exact potential d - g d' of Ng, Harada and Russell (1999), where d' = 0 at the end of an
# episode, which leaves the best policy as it is; or not at all, as the learner itself reads
# `goal_way` (HuRL).
SHAPINGS = ("difference", "potential", "hurl")
DIFFERENCE, POTENTIAL, HURL = range(len(SHAPINGS))

# A vehicle steers widely beyond this angle [rad].
WIDE = math.radians(15.0)
STANDS_BELOW = 0.05  # [m/s]

# How an episode ended, by `episode.ending`.
ENDINGS = tuple(ending.name.lower() for ending in Ending)


@kernel
def look(world: World, buffers: Buffers, field: Field, w: int, k: int) -> None:
    """Record where a learning vehicle stands before a decision."""
    before, body, vehicle = buffers.before[w, k], world.bodies[w, k], world.vehicles[w, k]
    parker = world.parking.parkers[w, k]
    before.turn = abs(stand_of(parker, vehicle, body, judged_box(parker, vehicle)).turn)
    heuristic = int(buffers.settings[0].heuristic)
    if heuristic == EUCLID:  # asked for most, and needs neither chart nor poses of axles
        before.way = straight_way(middle_of(body, vehicle, parker), goal_of(vehicle, parker))
        return
    chart = chart_of(world, field, w, buffers.rounds[w].world, k)
    before.way = way_left(heuristic, aim_of(body, vehicle, parker), chart)


@kernel
def judge(world: World, buffers: Buffers, field: Field, w: int, k: int) -> bool:
    """Compute terms, reward and end of a learning vehicle's decision; return whether it is over.

    Fills `buffers.terms[w, k]`, (T,), in the order of TERMS.
    """
    body, parker = world.bodies[w, k], world.parking.parkers[w, k]
    ending = ending_of(body.status, world.racers[w, k].retired_for, parker.touched)
    vehicle = world.vehicles[w, k]
    stand = stand_of(parker, vehicle, body, judged_box(parker, vehicle))
    off = abs(stand_of(parker, vehicle, body, vehicle.trailer_count).turn)
    # Time that runs out cuts an episode off, unless the task calls it an end.
    is_late = ending == codes.IS_LATE and buffers.settings[0].late_ends == 0.0
    is_over = ending != codes.OPEN and not is_late
    _measure(world, buffers, w, k, ending, stand, off)
    _measure_way(world, buffers, field, w, k, is_over)
    weigh_terms(buffers, w, k)
    _record_figures(world, buffers, w, k, ending, off)
    return close_episode(buffers, w, k, is_over, is_late)


@kernel
def _measure_way(
    world: World, buffers: Buffers, field: Field, w: int, k: int, is_over: bool
) -> None:
    """Measure what depends on the heuristic, and record where the vehicle stands now."""
    settings, terms, before = buffers.settings[0], buffers.terms[w, k], buffers.before[w, k]
    way = before.way
    look(world, buffers, field, w, k)
    left, progress = before.way, 0.0
    if settings.shaping == DIFFERENCE:
        progress = way - left
    elif settings.shaping == POTENTIAL:
        progress = way if is_over else way - settings.discount * left
    terms[GOAL_PROGRESS] = progress
    terms[GOAL_WAY] = left


@kernel
def _measure(
    world: World, buffers: Buffers, w: int, k: int, ending: int, stand: Stand, off: float
) -> None:
    """Measure the terms of one learning vehicle.

    ending: Ending; stand: of the box that is judged; off: between the last box's heading and the
    slot's [rad].
    """
    body, before, terms = world.bodies[w, k], buffers.before[w, k], buffers.terms[w, k]
    distance = math.sqrt(stand.along * stand.along + stand.across * stand.across)
    turn = abs(stand.turn)
    limit = max(world.rules[w].limit_ticks, 1)
    share = buffers.settings[0].decision_ticks / limit
    is_aligned = off <= ALIGNED_WITHIN
    terms[PARKED] = 1.0 if ending == codes.IS_PARKED else 0.0
    terms[ALIGNED] = 1.0 if ending == codes.IS_PARKED and is_aligned else 0.0
    terms[MISPARKED] = 1.0 if ending == codes.IS_PARKED and not is_aligned else 0.0
    terms[CRASH] = 1.0 if codes.MET_WALL <= ending <= codes.MET_PERSON else 0.0
    terms[PERSON] = 1.0 if ending == codes.MET_PERSON else 0.0
    terms[LEFT] = 1.0 if ending == codes.HAS_LEFT else 0.0
    terms[LATE] = 1.0 if ending == codes.IS_LATE else 0.0
    terms[TIME] = share
    terms[REVERSING] = share if body.throttle < 0.0 else 0.0
    terms[STEERING_WIDE] = share if abs(body.steering) > WIDE else 0.0
    terms[STANDING] = share if abs(body.speed) < STANDS_BELOW else 0.0
    terms[GOAL_DISTANCE] = distance * share
    terms[GOAL_TURN] = (before.turn - turn) / (1.0 + distance)
    terms[STEERING_CHANGE] = abs(body.steering_command - before.steering)
    before.steering = body.steering_command
    terms[TOUCH] = _new_touches(world, before, w, k) if ending == codes.OPEN else 0.0
    is_bent = ending in (codes.HAS_JACK_KNIFED, codes.MET_ITSELF)
    terms[JACK_KNIFE] = 1.0 if is_bent else 0.0


@kernel
def _new_touches(world: World, before: Record, w: int, k: int) -> float:
    """Return how often a vehicle has run into something since this was asked last."""
    touches = world.racers[w, k].contacts + world.racers[w, k].wall_contacts
    hits = 0  # people whom it is running into
    for p in range(world.parking.walkers.shape[1]):
        hits += (world.parking.walkers[w, p].hit >> k) & 1
    new = touches - before.touches + max(hits - before.hits, 0.0)
    before.touches, before.hits = touches, hits
    return float(new)


@kernel
def _record_figures(
    world: World, buffers: Buffers, w: int, k: int, ending: int, off: float
) -> None:
    """Record what a learning vehicle's episode has come to so far."""
    parker, episode = world.parking.parkers[w, k], buffers.episodes[w, k]
    episode.parked = 1 if ending == codes.IS_PARKED else 0
    episode.ending = ending
    episode.turn = off
    episode.way, episode.reversed = parker.way, parker.reversed
    episode.moves = parker.moves
    episode.walked_into = parker.walked_into
    episode.ticks = world.races[w].tick - world.races[w].start_tick
