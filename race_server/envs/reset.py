"""New rounds and new episodes: where karts begin, in which scenario, with which reality gap."""

from race_server.core import codes
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.kernels.rng import (
    EPISODE_STREAM,
    GRID_STREAM,
    RESPAWN_STREAM,
    SCENARIO_STREAM,
    START_STREAM,
    bits,
    uniform,
)
from race_server.core.rules.laps import microseconds
from race_server.core.stages.grid import line_up, place_kart
from race_server.core.stages.observe import observe
from race_server.core.stages.sensing import sense_first
from race_server.core.stages.standings import rank
from race_server.core.state import HAZARDS, World
from race_server.envs.buffers import Buffers, Templates
from race_server.envs.reality_gap import OBSERVATION_DELAY, draw_gap

# So often a random start is drawn again where another kart stands, before it is taken anyway.
START_TRIES = 24
SEED_SHIFT = 1  # a seed of 63 bits is never negative


@large_kernel
def begin_round(world: World, rig: Buffers, templates: Templates, w: int) -> None:
    """Draw a scenario for one world and put every kart at its start."""
    turn = rig.rounds[w]
    turn.number += 1
    turn.steps = 0
    turn.entries = 0
    scenario = _draw_scenario(rig, turn.seed, turn.number)
    turn.scenario = scenario
    world.races[w] = templates.races[scenario]
    world.rules[w] = templates.rules[scenario]
    world.races[w].seed = _fresh_seed(turn.seed, turn.number)
    for box in range(world.boxes.shape[1]):
        world.boxes[w, box] = templates.boxes[scenario, box]
    for index in range(HAZARDS):
        world.hazards[w, index].until_tick = 0
    for k in range(world.bodies.shape[1]):
        world.bodies[w, k] = templates.bodies[scenario, k]
        world.racers[w, k] = templates.racers[scenario, k]
        world.players[w, k] = templates.players[scenario, k]
        world.vehicles[w, k] = templates.vehicles[scenario, k]
        _forget(rig, w, k)
    if rig.settings[0].random_grid:
        _shuffle_grid(world, w)
    # Entry 0: those of the places begin at 1.
    is_spread = uniform(world.races[w].seed, START_STREAM, 0, 0) < rig.settings[0].random_start
    for k in range(world.bodies.shape[1]):
        if is_spread and world.bodies[w, k].status != codes.ABSENT:
            _find_start(world, rig, templates, w, k, START_STREAM)
    line_up(world, w)
    for k in range(rig.rewards.shape[1]):
        begin_episode(world, rig, w, k)


@kernel
def _forget(rig: Buffers, w: int, k: int) -> None:
    """Let what a scripted driver remembers, and what it commanded last, be nothing."""
    for number in range(rig.memory.shape[2]):
        rig.memory[w, k, number] = 0.0
    for number in range(4):
        rig.controls[w, k, number] = 0.0


@kernel
def _fresh_seed(seed: int, number: int) -> int:
    return int(bits(seed, EPISODE_STREAM, number, 0) >> SEED_SHIFT)


@kernel
def _draw_scenario(rig: Buffers, seed: int, number: int) -> int:
    chance = uniform(seed, SCENARIO_STREAM, number, 0)
    for scenario in range(len(rig.odds) - 1):
        if chance < rig.odds[scenario]:
            return scenario
    return len(rig.odds) - 1


@kernel
def _shuffle_grid(world: World, w: int) -> None:
    """Let the karts of one world change places on the grid (Fisher and Yates)."""
    bodies, seed = world.bodies, world.races[w].seed
    for last in range(bodies.shape[1] - 1, 0, -1):
        other = int(uniform(seed, GRID_STREAM, last, 0) * (last + 1))
        one, two = bodies[w, last], bodies[w, other]
        if one.status != codes.ABSENT and two.status != codes.ABSENT:
            one.x, two.x = two.x, one.x
            one.y, two.y = two.y, one.y
            one.heading, two.heading = two.heading, one.heading
            one_place, two_place = world.racers[w, last], world.racers[w, other]
            one_place.grid_place, two_place.grid_place = two_place.grid_place, one_place.grid_place


@kernel
def _find_start(
    world: World, rig: Buffers, templates: Templates, w: int, k: int, stream: int
) -> None:
    """Put a kart at a random place of the scenario's table, clear of those placed before."""
    turn, body = rig.rounds[w], world.bodies[w, k]
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
        if attempt == START_TRIES - 1 or _is_clear(world, w, k, others, x, y):
            body.x, body.y = x, y
            body.heading = start[4] + (2.0 * uniform(seed, stream, first, 3) - 1.0) * start[5]
            return


@kernel
def _is_clear(world: World, w: int, k: int, others: int, x: float, y: float) -> bool:
    for other in range(others):
        rival = world.bodies[w, other]
        if other == k or rival.status == codes.ABSENT:
            continue
        near = 1.5 * world.vehicles[w, other].length
        dx, dy = rival.x - x, rival.y - y
        if dx * dx + dy * dy < near * near:
            return False
    return True


@kernel
def begin_episode(world: World, rig: Buffers, w: int, k: int) -> None:
    """Start the bookkeeping of one learning kart anew and draw its reality gap."""
    number = rig.episodes[w, k].number + 1
    episode = rig.episodes[w, k]
    episode.total = 0.0
    episode.steps = 0
    episode.laps = 0
    episode.best_lap_us = 0
    episode.last_lap_us = 0
    episode.contacts = 0
    episode.wall_contacts = 0
    episode.crashes = 0
    episode.status = world.bodies[w, k].status
    episode.rank = world.racers[w, k].rank
    episode.number = number
    rig.idle[w, k] = 1 if world.bodies[w, k].status == codes.ABSENT else 0
    for index in range(rig.commanded.shape[2]):
        rig.commanded[w, k, index] = 0.0
    for late in range(rig.delayed.shape[2]):
        for index in range(4):
            rig.delayed[w, k, late, index] = 0.0
    vehicle = world.vehicles[w, k]
    draw_gap(rig.rounds[w].seed, number, k, rig.gap, rig.draws[w, k], vehicle)


@large_kernel
def reenter(world: World, rig: Buffers, templates: Templates, w: int, k: int) -> None:
    """Let a kart whose episode is over come back as a new one, at a place that is clear."""
    scenario = rig.rounds[w].scenario
    world.bodies[w, k] = templates.bodies[scenario, k]
    world.racers[w, k] = templates.racers[scenario, k]
    world.players[w, k] = templates.players[scenario, k]
    world.vehicles[w, k] = templates.vehicles[scenario, k]
    _forget(rig, w, k)
    _find_start(world, rig, templates, w, k, RESPAWN_STREAM)
    place_kart(world, w, k)
    racer, race = world.racers[w, k], world.races[w]
    now_us = max(microseconds(race.tick - race.start_tick, 0.0), 0)
    racer.lap_start_us = racer.sector_start_us = now_us
    rank(world, w)
    sense_first(world, w, k)
    if k < rig.rewards.shape[1]:
        begin_episode(world, rig, w, k)


@large_kernel
def write_observation(world: World, rig: Buffers, w: int, k: int) -> None:
    """Put the observation that a learning kart is to have now into `rig.observations`."""
    depth = rig.late.shape[2]
    if depth == 0:
        observe(world, w, k, rig.parts, rig.observations[w, k])
        return
    # The ring holds the newest observations; the drawn delay says which is seen.
    steps = rig.episodes[w, k].steps
    observe(world, w, k, rig.parts, rig.late[w, k, steps % depth])
    age = min(int(rig.draws[w, k, OBSERVATION_DELAY]), steps)
    seen = (steps - age) % depth
    for index in range(rig.observations.shape[2]):
        rig.observations[w, k, index] = rig.late[w, k, seen, index]
