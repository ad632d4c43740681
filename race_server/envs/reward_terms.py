"""What a decision was worth, and whether it was the last one."""

import math

from race_server.core import codes
from race_server.core.kernels.jit import kernel
from race_server.core.rules.ranking import is_ahead
from race_server.core.stages.events import retire
from race_server.core.state import World
from race_server.envs.buffers import Buffers

# Terms, in the order of `rewards.TERMS`.
PROGRESS, SPEED, RANGE, CRASH, CONTACT, WALL, WRONG_WAY, OFF_TRACK = range(8)
PLACES, ITEM, LAP, FINISH, TIME, REPORT_B, LEAD = range(8, 15)

REPORT_B_CRASH = -300.0
REPORT_B_RANGE, REPORT_B_SPEED = 12.0, 3.0

# So many lengths ahead of a rival a kart is half as far ahead as it can be: about a second.
LEAD_LENGTHS = 10.0


@kernel
def snapshot_counters(world: World, rig: Buffers, w: int) -> None:
    """Note the counters of the learning karts before a decision."""
    for k in range(rig.rewards.shape[1]):
        racer, player, before = world.racers[w, k], world.players[w, k], rig.before[w, k]
        before.distance = racer.distance
        before.contacts = racer.contacts
        before.wall_contacts = racer.wall_contacts
        before.rank = racer.rank
        before.lead = lead_of(world, w, k) if rig.weights[LEAD] != 0.0 else 0.0
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
def reward_terms(world: World, rig: Buffers, w: int, k: int) -> None:
    """Work out reward terms, reward and end of one learning kart after a decision."""
    settings = rig.settings[0]
    body, racer, player = world.bodies[w, k], world.racers[w, k], world.players[w, k]
    before, terms = rig.before[w, k], rig.terms[w, k]
    needs_range = settings.crash_range > 0.0 or rig.weights[RANGE] != 0.0
    near = math.inf
    if needs_range or rig.weights[REPORT_B] != 0.0:
        near = nearest_range(world, w, k)
    if near < settings.crash_range:
        retire(world, w, k, codes.CRASH)
    crashed = body.status == codes.RETIRED and racer.retired_for == codes.CRASH
    terms[PROGRESS] = racer.distance - before.distance
    terms[SPEED] = body.speed
    terms[RANGE] = near if near < math.inf else 0.0
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
    terms[REPORT_B] = 0.0
    if rig.weights[REPORT_B] != 0.0:
        fair = REPORT_B_RANGE * near + REPORT_B_SPEED * body.speed
        terms[REPORT_B] = REPORT_B_CRASH if crashed else fair
    terms[LEAD] = lead_of(world, w, k) - before.lead if rig.weights[LEAD] != 0.0 else 0.0
    reward = 0.0
    for term in range(len(rig.weights)):
        reward += rig.weights[term] * terms[term]
    rig.rewards[w, k] = reward
    _end(world, rig, w, k, reward)


@kernel
def _end(world: World, rig: Buffers, w: int, k: int, reward: float) -> None:
    body, racer = world.bodies[w, k], world.racers[w, k]
    settings, episode = rig.settings[0], rig.episodes[w, k]
    episode.total += reward
    episode.steps += 1
    episode.laps = racer.laps
    episode.best_lap_us = racer.best_lap_us
    episode.last_lap_us = racer.last_lap_us
    episode.contacts = racer.contacts
    episode.wall_contacts = racer.wall_contacts
    episode.crashes = 1 if rig.terms[w, k, CRASH] > 0.0 else 0
    episode.status = body.status
    episode.rank = racer.rank
    # Time that runs out cuts an episode off; anything else that takes the kart out ends it.
    late = body.status == codes.RETIRED and racer.retired_for == codes.TIME_OUT
    if body.status != codes.RACING and not late:
        rig.terminated[w, k] = 1
    elif late or 0 < settings.most_steps <= episode.steps:
        rig.truncated[w, k] = 1
