"""Reward terms of racing: their names, the tables that weigh them, and how they are measured."""

import math
from collections.abc import Mapping
from types import MappingProxyType

from race_server.core import codes
from race_server.core.kernels.jit import kernel
from race_server.core.rules.ranking import is_ahead
from race_server.core.stages.events import retire
from race_server.core.state import Floats, World
from race_server.envs.buffers import Buffers
from race_server.envs.decision import close_episode, weigh_terms
from race_server.envs.rewards import weights_of

# What each term measures over one decision of one kart. The order is that of the numbers
# below; a test holds the two together.
TERMS: Mapping[str, str] = MappingProxyType(
    {
        "progress": "distance gained along the centre line [m]",
        "speed": "forward speed [m/s]",
        "range": "nearest lidar range [m], 0 once out; only measured where it has a weight, or "
        "`crash_range` is set",
        "crash": "1 if the kart crashed and is out",
        "contact": "contacts with other karts that began",
        "wall": "contacts with walls that began",
        "wrong_way": "1 while driving the wrong way",
        "off_track": "1 while off the track",
        "places": "places gained",
        "item": "items used",
        "lap": "laps completed",
        "finish": "1 if the kart finished its race",
        "time": "1, always",
        "lead": "gain in the sum over all rivals of how far ahead of them the kart is, each from "
        "-1 to 1: by distance while both race, half of it at 10 lengths, then by place; only "
        "measured where it has a weight",
    }
)

REWARDS: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {
        "progress": {"progress": 1.0, "wall": -0.5, "crash": -1.0, "wrong_way": -0.5},
        "race": {
            "progress": 1.0,
            "places": 1.0,
            "contact": -0.3,
            "wall": -0.5,
            "crash": -10.0,
            "wrong_way": -0.5,
            "off_track": -0.2,
            "finish": 10.0,
        },
        # Report of the 1/10 race, 2023: -300 at a crash, else 12 times the nearest range plus 3
        # times the speed, printed without units.
        "report_b": {"range": 12.0, "speed": 3.0, "crash": -300.0},
    }
)

PROGRESS, SPEED, RANGE, CRASH, CONTACT, WALL, WRONG_WAY, OFF_TRACK = range(8)
PLACES, ITEM, LAP, FINISH, TIME, LEAD = range(8, 14)

# A kart that is this many lengths ahead of a rival counts half as much as one far ahead: about a
# second.
LEAD_LENGTHS = 10.0


def reward_weights(reward: str | Mapping[str, float]) -> Floats:
    """Return the weight of every term, shape (T,), from a table or the name of one.

    Raises:
        ScenarioError: no such table or term.
    """
    return weights_of(reward, TERMS, REWARDS)


@kernel
def snapshot_counters(world: World, buffers: Buffers, w: int) -> None:
    """Record the counters of the learning karts before a decision."""
    for k in range(buffers.rewards.shape[1]):
        racer, player, before = world.racers[w, k], world.players[w, k], buffers.before[w, k]
        before.distance = racer.distance
        before.contacts = racer.contacts
        before.wall_contacts = racer.wall_contacts
        before.rank = racer.rank
        before.lead = lead_of(world, w, k) if buffers.weights[LEAD] != 0.0 else 0.0
        before.items_used = player.items_used
        before.laps = racer.laps


@kernel
def lead_of(world: World, w: int, k: int) -> float:
    """Return how far a kart is ahead of its rivals: the sum of a number from -1 to 1 for each.

    While both race, distances decide, squashed; afterwards the order of finish. So what a race
    adds up to is the place at its end, but for where it began.
    """
    body, racer, total = world.bodies[w, k], world.racers[w, k], 0.0
    half = LEAD_LENGTHS * world.vehicles[w, k].length
    for other in range(world.bodies.shape[1]):
        rival_body, rival_racer = world.bodies[w, other], world.racers[w, other]
        if other == k or rival_body.status == codes.ABSENT:
            continue
        if body.status == codes.RACING and rival_body.status == codes.RACING:
            gap = racer.ranked - rival_racer.ranked
            total += gap / (abs(gap) + half)
        else:
            total += 1.0 if is_ahead(body, racer, rival_body, rival_racer) else -1.0
    return total


@kernel
def nearest_range(world: World, w: int, k: int) -> float:
    """Return the nearest lidar range [m]; drop-outs do not count; the reach without a lidar."""
    best = world.sensors[0].lidar_reach
    if world.bodies[w, k].sensors & codes.LIDAR:
        for ray in range(world.sight.lidar.shape[3]):
            value = float(world.sight.lidar[w, k, 0, ray])
            if 0.0 < value < best:
                best = value
    return best


@kernel
def judge(world: World, buffers: Buffers, w: int, k: int) -> bool:
    """Compute terms, reward and end of a learning kart's decision; return whether it was the last.

    Fills `buffers.terms[w, k]`, (T,), in the order of TERMS.
    """
    settings = buffers.settings[0]
    near = math.inf
    if settings.crash_range > 0.0 or buffers.weights[RANGE] != 0.0:
        near = nearest_range(world, w, k)
    if near < settings.crash_range:
        retire(world, w, k, codes.CRASH)
    _measure(world, buffers, w, k, near)
    weigh_terms(buffers, w, k)
    _record_figures(world, buffers, w, k)
    # Time that runs out cuts an episode off; anything else that takes the kart out ends it.
    status = world.bodies[w, k].status
    is_late = status == codes.RETIRED and world.racers[w, k].retired_for == codes.TIME_OUT
    is_over = status != codes.RACING and not is_late
    return close_episode(buffers, w, k, is_over, is_late)


@kernel
def _measure(world: World, buffers: Buffers, w: int, k: int, near: float) -> None:
    """Measure the terms of one learning kart. near: nearest lidar range [m], or infinity."""
    body, racer, player = world.bodies[w, k], world.racers[w, k], world.players[w, k]
    before, terms = buffers.before[w, k], buffers.terms[w, k]
    crashed = body.status == codes.RETIRED and racer.retired_for == codes.CRASH
    terms[PROGRESS] = racer.distance - before.distance
    terms[SPEED] = body.speed
    terms[RANGE] = near if body.status == codes.RACING and near < math.inf else 0.0
    terms[CRASH] = 1.0 if crashed else 0.0
    terms[CONTACT] = racer.contacts - before.contacts
    terms[WALL] = racer.wall_contacts - before.wall_contacts
    terms[WRONG_WAY] = racer.wrong_way
    terms[OFF_TRACK] = racer.off_track
    terms[PLACES] = before.rank - racer.rank
    terms[ITEM] = player.items_used - before.items_used
    terms[LAP] = racer.laps - before.laps
    terms[FINISH] = 1.0 if body.status == codes.FINISHED else 0.0
    terms[TIME] = 1.0
    terms[LEAD] = lead_of(world, w, k) - before.lead if buffers.weights[LEAD] != 0.0 else 0.0


@kernel
def _record_figures(world: World, buffers: Buffers, w: int, k: int) -> None:
    """Record what a learning kart's episode has come to so far."""
    racer, episode = world.racers[w, k], buffers.episodes[w, k]
    episode.laps = racer.laps
    episode.best_lap_us = racer.best_lap_us
    episode.last_lap_us = racer.last_lap_us
    episode.contacts = racer.contacts
    episode.wall_contacts = racer.wall_contacts
    episode.crashes = 1 if buffers.terms[w, k, CRASH] > 0.0 else 0
    episode.status = world.bodies[w, k].status
    episode.rank = racer.rank
