"""One decision of every race, in order: the training world's counterpart of `core/step.py`."""

from race_server.core import codes
from race_server.core.kernels.jit import kernel, written_out
from race_server.core.state import World
from race_server.core.step import advance_world
from race_server.envs.buffers import REENTER, RESET_WORLD, Buffers
from race_server.envs.decision import all_are_idle, clear_outcome, command_learners
from race_server.envs.observations import write_observations, write_terminal
from race_server.envs.racing.reset import RaceTemplates, begin_round, reenter
from race_server.envs.racing.reward_terms import judge, snapshot_counters


@kernel
def decide(world: World, buffers: Buffers, templates: RaceTemplates) -> None:
    """Move every world on by one decision: actions in, observations, rewards and ends out."""
    for w in range(world.bodies.shape[0]):
        _take_actions(world, buffers, w)
        advance_world(world, w, buffers.controls[w], buffers.settings[0].decision_ticks)
        _give_outcomes(world, buffers, templates, w)


@kernel
def take_actions(world: World, buffers: Buffers, templates: RaceTemplates) -> None:
    """Do what `decide` does before its ticks, where another simulator moves the karts in them."""
    for w in range(world.bodies.shape[0]):
        _take_actions(world, buffers, w)


@kernel
def give_outcomes(world: World, buffers: Buffers, templates: RaceTemplates) -> None:
    """Do what `decide` does after its ticks."""
    for w in range(world.bodies.shape[0]):
        _give_outcomes(world, buffers, templates, w)


@written_out
def _take_actions(world: World, buffers: Buffers, w: int) -> None:
    world.event_counts[w] = 0
    command_learners(world, buffers, w)
    snapshot_counters(world, buffers, w)


@written_out
def _give_outcomes(world: World, buffers: Buffers, templates: RaceTemplates, w: int) -> None:
    buffers.rounds[w].steps += 1
    for k in range(buffers.rewards.shape[1]):
        if clear_outcome(buffers, w, k) and judge(world, buffers, w, k):
            write_terminal(world, buffers, w, k)
    _replace_what_is_over(world, buffers, templates, w)
    write_observations(world, buffers, w)


@kernel
def restart(world: World, buffers: Buffers, templates: RaceTemplates) -> None:
    """Begin a new round in every world."""
    for w in range(world.bodies.shape[0]):
        world.event_counts[w] = 0
        begin_round(world, buffers, templates, w)
        write_observations(world, buffers, w)


@written_out
def _replace_what_is_over(world: World, buffers: Buffers, templates: RaceTemplates, w: int) -> None:
    """Begin a new round, or let single karts re-enter, as `settings.after` says."""
    after = buffers.settings[0].after
    if after == RESET_WORLD:
        if all_are_idle(buffers, w):
            begin_round(world, buffers, templates, w)
    elif after == REENTER:
        if world.races[w].over:
            # The clock of the race ran out, or no kart is left in it.
            begin_round(world, buffers, templates, w)
            return
        learners = buffers.rewards.shape[1]
        for k in range(world.bodies.shape[1]):
            status = world.bodies[w, k].status
            over = buffers.idle[w, k] == 1 if k < learners else status != codes.RACING
            if over and status != codes.ABSENT:
                reenter(world, buffers, templates, w, k)
