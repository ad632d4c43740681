"""New rounds and new episodes of racing: where karts begin, and under which rules."""

from typing import NamedTuple

from race_server.core import codes
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.rng import GRID_STREAM, RESPAWN_STREAM, START_STREAM, uniform
from race_server.core.kernels.trailers import straighten
from race_server.core.rules.laps import microseconds
from race_server.core.stages.clearance import is_clear
from race_server.core.stages.grid import line_up, place_kart
from race_server.core.stages.sensing import sense_first
from race_server.core.stages.standings import rank
from race_server.core.state import HAZARDS, Floats, Ints, Records, World
from race_server.envs.buffers import Buffers
from race_server.envs.rounds import begin_episode, next_round, put_from_template, seed_of_round

# A random start is drawn at most this many times; the last draw is taken even where a kart stands.
START_TRIES = 24


class RaceTemplates(NamedTuple):
    """What each scenario's world looks like at its start."""

    races: Records  # (S,) RACE
    rules: Records  # (S,) RULES
    bodies: Records  # (S, K) BODY
    racers: Records  # (S, K) RACER
    players: Records  # (S, K) PLAYER
    vehicles: Records  # (S, K) VEHICLE
    boxes: Records  # (S, I) BOX
    starts: Floats  # (S, B, 6) x0, x1, y0, y1 [m], heading, spread [rad]
    start_counts: Ints  # (S,)


@large_kernel
def begin_round(world: World, buffers: Buffers, templates: RaceTemplates, w: int) -> None:
    """Draw a scenario for one world and put every kart at its start."""
    scenario = next_round(buffers, w)
    world.races[w] = templates.races[scenario]
    world.rules[w] = templates.rules[scenario]
    world.races[w].seed = seed_of_round(buffers, w)
    for box in range(world.boxes.shape[1]):
        world.boxes[w, box] = templates.boxes[scenario, box]
    for index in range(HAZARDS):
        world.hazards[w, index].until_tick = 0
    for k in range(world.bodies.shape[1]):
        put_from_template(world, buffers, templates, w, k)
    if buffers.settings[0].random_grid:
        _shuffle_grid(world, w)
    # Entry 0: those of the places begin at 1.
    is_spread = uniform(world.races[w].seed, START_STREAM, 0, 0) < buffers.settings[0].random_start
    for k in range(world.bodies.shape[1]):
        if is_spread and world.bodies[w, k].status != codes.ABSENT:
            _find_start(world, buffers, templates, w, k, START_STREAM)
    line_up(world, w)
    for k in range(buffers.rewards.shape[1]):
        _begin_race(world, buffers, w, k)


@kernel
def _shuffle_grid(world: World, w: int) -> None:
    """Shuffle the karts of one world on the grid (Fisher and Yates)."""
    bodies, seed = world.bodies, world.races[w].seed
    for last in range(bodies.shape[1] - 1, 0, -1):
        other = int(uniform(seed, GRID_STREAM, last, 0) * (last + 1))
        one, two = bodies[w, last], bodies[w, other]
        if one.status != codes.ABSENT and two.status != codes.ABSENT:
            one.x, two.x = two.x, one.x
            one.y, two.y = two.y, one.y
            one.heading, two.heading = two.heading, one.heading
            straighten(one, world.vehicles[w, last])
            straighten(two, world.vehicles[w, other])
            one_racer, two_racer = world.racers[w, last], world.racers[w, other]
            place = one_racer.grid_place
            one_racer.grid_place, two_racer.grid_place = two_racer.grid_place, place


@kernel
def _find_start(
    world: World, buffers: Buffers, templates: RaceTemplates, w: int, k: int, stream: int
) -> None:
    """Put a kart at a random place of the scenario's table, clear of those placed before."""
    turn, body = buffers.rounds[w], world.bodies[w, k]
    scenario = turn.scenario
    others = world.bodies.shape[1] if stream == RESPAWN_STREAM else k
    for attempt in range(START_TRIES):
        turn.entries += 1
        first = turn.entries * 4
        seed = world.races[w].seed
        row = int(uniform(seed, stream, first, 0) * templates.start_counts[scenario])
        start = templates.starts[scenario, row]
        x = start[0] + uniform(seed, stream, first, 1) * (start[1] - start[0])
        y = start[2] + uniform(seed, stream, first, 2) * (start[3] - start[2])
        is_last = attempt == START_TRIES - 1
        if is_last or is_clear(world, w, k, others, x, y, codes.RETIRED):
            body.x, body.y = x, y
            body.heading = start[4] + (2.0 * uniform(seed, stream, first, 3) - 1.0) * start[5]
            straighten(body, world.vehicles[w, k])
            # No gate is missed before its first timing line, though it drives by some.
            world.racers[w, k].cutting = 1
            return


@kernel
def _begin_race(world: World, buffers: Buffers, w: int, k: int) -> None:
    """Begin a new episode of one learning kart, from where it stands in its race."""
    status, episode = world.bodies[w, k].status, buffers.episodes[w, k]
    begin_episode(world, buffers, w, k, status == codes.ABSENT)
    episode.laps = 0
    episode.best_lap_us = 0
    episode.last_lap_us = 0
    episode.contacts = 0
    episode.wall_contacts = 0
    episode.crashes = 0
    episode.status = status
    episode.rank = world.racers[w, k].rank


@large_kernel
def reenter(world: World, buffers: Buffers, templates: RaceTemplates, w: int, k: int) -> None:
    """Put a kart whose episode is over back as a new one, at a place that is clear."""
    put_from_template(world, buffers, templates, w, k)
    _find_start(world, buffers, templates, w, k, RESPAWN_STREAM)
    place_kart(world, w, k)
    racer, race = world.racers[w, k], world.races[w]
    now_us = max(microseconds(race.tick - race.start_tick, 0.0), 0)
    racer.lap_start_us = racer.sector_start_us = now_us
    rank(world, w)
    sense_first(world, w, k)
    if k < buffers.rewards.shape[1]:
        _begin_race(world, buffers, w, k)
