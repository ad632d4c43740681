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
        kart, before = world.karts[w, k], rig.before[w, k]
        before.distance = kart.distance
        before.contacts = kart.contacts
        before.wall_contacts = kart.wall_contacts
        before.rank = kart.rank
        before.lead = lead_of(world, w, k) if rig.weights[LEAD] != 0.0 else 0.0
        before.items_used = kart.items_used
        before.laps = kart.laps


@kernel
def lead_of(world: World, w: int, k: int) -> float:
    """Return how far a kart is ahead of its rivals: the sum of a number from -1 to 1 for each.

    While both race, distances decide, squashed; afterwards the order of finish. So what a race
    adds up to is the place at its end, but for where it began.
    """
    kart, total = world.karts[w, k], 0.0
    half = LEAD_LENGTHS * world.vehicles[w, k].length
    for other in range(world.karts.shape[1]):
        rival = world.karts[w, other]
        if other == k or rival.status == codes.ABSENT:
            continue
        if kart.status == codes.RACING and rival.status == codes.RACING:
            gap = kart.ranked - rival.ranked
            total += gap / (abs(gap) + half)
        else:
            total += 1.0 if is_ahead(kart, rival) else -1.0
    return total


@kernel
def nearest_range(world: World, w: int, k: int) -> float:
    """Return the nearest lidar range [m]; drop-outs do not count; the reach without a lidar."""
    best = world.sensors[0].lidar_reach
    if world.karts[w, k].sensors & codes.LIDAR:
        for ray in range(world.sight.lidar.shape[3]):
            value = float(world.sight.lidar[w, k, 0, ray])
            if 0.0 < value < best:
                best = value
    return best


@kernel
def reward_terms(world: World, rig: Buffers, w: int, k: int) -> None:
    """Work out reward terms, reward and end of one learning kart after a decision."""
    settings = rig.settings[0]
    kart, before, terms = world.karts[w, k], rig.before[w, k], rig.terms[w, k]
    needs_range = settings.crash_range > 0.0 or rig.weights[RANGE] != 0.0
    near = math.inf
    if needs_range or rig.weights[REPORT_B] != 0.0:
        near = nearest_range(world, w, k)
    if near < settings.crash_range:
        retire(world, w, k, codes.CRASH)
    crashed = kart.status == codes.RETIRED and kart.retired_for == codes.CRASH
    terms[PROGRESS] = kart.distance - before.distance
    terms[SPEED] = kart.speed
    terms[RANGE] = near if near < math.inf else 0.0
    terms[CRASH] = 1.0 if crashed else 0.0
    terms[CONTACT] = kart.contacts - before.contacts
    terms[WALL] = kart.wall_contacts - before.wall_contacts
    terms[WRONG_WAY] = kart.wrong_way
    terms[OFF_TRACK] = kart.off_track
    terms[PLACES] = before.rank - kart.rank
    terms[ITEM] = kart.items_used - before.items_used
    terms[LAP] = kart.laps - before.laps
    terms[FINISH] = 1.0 if kart.status == codes.FINISHED else 0.0
    terms[TIME] = 1.0
    terms[REPORT_B] = 0.0
    if rig.weights[REPORT_B] != 0.0:
        fair = REPORT_B_RANGE * near + REPORT_B_SPEED * kart.speed
        terms[REPORT_B] = REPORT_B_CRASH if crashed else fair
    terms[LEAD] = lead_of(world, w, k) - before.lead if rig.weights[LEAD] != 0.0 else 0.0
    reward = 0.0
    for term in range(len(rig.weights)):
        reward += rig.weights[term] * terms[term]
    rig.rewards[w, k] = reward
    _end(world, rig, w, k, reward)


@kernel
def _end(world: World, rig: Buffers, w: int, k: int, reward: float) -> None:
    kart, settings, episode = world.karts[w, k], rig.settings[0], rig.episodes[w, k]
    episode.total += reward
    episode.steps += 1
    episode.laps = kart.laps
    episode.best_lap_us = kart.best_lap_us
    episode.last_lap_us = kart.last_lap_us
    episode.contacts = kart.contacts
    episode.wall_contacts = kart.wall_contacts
    episode.crashes = 1 if rig.terms[w, k, CRASH] > 0.0 else 0
    episode.status = kart.status
    episode.rank = kart.rank
    # Time that runs out cuts an episode off; anything else that takes the kart out ends it.
    late = kart.status == codes.RETIRED and kart.retired_for == codes.TIME_OUT
    if kart.status != codes.RACING and not late:
        rig.terminated[w, k] = 1
    elif late or 0 < settings.most_steps <= episode.steps:
        rig.truncated[w, k] = 1
