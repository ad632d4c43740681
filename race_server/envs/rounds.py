"""Stages of a reset that every discipline shares: which scenario is drawn, and a clean record."""

from typing import Any

from race_server.core.kernels.jit import kernel
from race_server.core.kernels.rng import EPISODE_STREAM, SCENARIO_STREAM, bits, uniform
from race_server.core.state import World
from race_server.envs.buffers import Buffers
from race_server.envs.reality_gap import draw_gap

SEED_SHIFT = 1  # a seed of 63 bits is never negative


@kernel
def next_round(buffers: Buffers, w: int) -> int:
    """Count one world's next round, draw its scenario and return the scenario's number.

    The ranges of the reality gap are now those of the round, for all episodes that begin in it.
    """
    turn = buffers.rounds[w]
    turn.number += 1
    turn.steps = 0
    turn.entries = 0
    turn.scenario = _draw_scenario(buffers, turn.seed, turn.number)
    for factor in range(buffers.gap.shape[0]):
        for bound in range(2):
            buffers.round_gap[w, factor, bound] = buffers.gap[factor, bound]
    return turn.scenario


@kernel
def seed_of_round(buffers: Buffers, w: int) -> int:
    """Return the seed of one world's round: another for each."""
    turn = buffers.rounds[w]
    return int(bits(turn.seed, EPISODE_STREAM, turn.number, 0) >> SEED_SHIFT)


@kernel
def _draw_scenario(buffers: Buffers, seed: int, number: int) -> int:
    chance = uniform(seed, SCENARIO_STREAM, number, 0)
    for scenario in range(len(buffers.odds) - 1):
        if chance < buffers.odds[scenario]:
            return scenario
    return len(buffers.odds) - 1


@kernel
def put_from_template(world: World, buffers: Buffers, templates: Any, w: int, k: int) -> None:
    """Put a kart as the scenario of one world's round has it at the start.

    templates: of the discipline; bodies, racers, players and vehicles (S, K) are among them.
    """
    scenario = buffers.rounds[w].scenario
    world.bodies[w, k] = templates.bodies[scenario, k]
    world.racers[w, k] = templates.racers[scenario, k]
    world.players[w, k] = templates.players[scenario, k]
    world.vehicles[w, k] = templates.vehicles[scenario, k]
    forget_kart(buffers, w, k)


@kernel
def forget_kart(buffers: Buffers, w: int, k: int) -> None:
    """Clear what a kart's scripted driver remembers, and what was commanded last."""
    for number in range(buffers.memory.shape[2]):
        buffers.memory[w, k, number] = 0.0
    for number in range(4):
        buffers.controls[w, k, number] = 0.0


@kernel
def begin_episode(world: World, buffers: Buffers, w: int, k: int, is_absent: bool) -> None:
    """Clear the record of one learning kart and draw its reality gap.

    is_absent: it stays away from this round. The discipline's own fields are left to it.
    """
    episode = buffers.episodes[w, k]
    episode.total = 0.0
    episode.steps = 0
    episode.number += 1
    buffers.idle[w, k] = 1 if is_absent else 0
    for index in range(buffers.commanded.shape[2]):
        buffers.commanded[w, k, index] = 0.0
    for late in range(buffers.delayed.shape[2]):
        for index in range(4):
            buffers.delayed[w, k, late, index] = 0.0
    seed, vehicle = buffers.rounds[w].seed, world.vehicles[w, k]
    draw_gap(seed, episode.number, k, buffers.round_gap[w], buffers.draws[w, k], vehicle)
