"""One decision of every car park, in order: the counterpart of `envs/racing/decide.py`."""

from race_server.core.kernels.jit import kernel, written_out
from race_server.core.state import World
from race_server.core.step import advance_world
from race_server.envs.buffers import STAY, Buffers
from race_server.envs.decision import all_are_idle, clear_outcome, command_learners
from race_server.envs.observations import write_observations, write_terminal
from race_server.envs.parking.reset import LotTemplates, begin_round
from race_server.envs.parking.reward_terms import judge
from race_server.envs.parking.team import pay_team


@kernel
def decide(world: World, buffers: Buffers, templates: LotTemplates) -> None:
    """Move every world on by one decision: actions in, observations, rewards and ends out."""
    for w in range(world.bodies.shape[0]):
        _take_actions(world, buffers, w)
        advance_world(world, w, buffers.controls[w], buffers.settings[0].decision_ticks)
        _give_outcomes(world, buffers, templates, w)


@kernel
def take_actions(world: World, buffers: Buffers, templates: LotTemplates) -> None:
    """Do what `decide` does before its ticks, where another simulator moves vehicles in them."""
    for w in range(world.bodies.shape[0]):
        _take_actions(world, buffers, w)


@kernel
def give_outcomes(world: World, buffers: Buffers, templates: LotTemplates) -> None:
    """Do what `decide` does after its ticks."""
    for w in range(world.bodies.shape[0]):
        _give_outcomes(world, buffers, templates, w)


@written_out
def _take_actions(world: World, buffers: Buffers, w: int) -> None:
    world.event_counts[w] = 0
    command_learners(world, buffers, w)


@written_out
def _give_outcomes(world: World, buffers: Buffers, templates: LotTemplates, w: int) -> None:
    buffers.rounds[w].steps += 1
    for k in range(buffers.rewards.shape[1]):
        if clear_outcome(buffers, w, k) and judge(world, buffers, templates.field, w, k):
            write_terminal(world, buffers, w, k)
    if buffers.settings[0].team != 0.0:
        pay_team(world, buffers, w)
    # A vehicle that is done stays as a block, and none comes back before the round is over.
    if buffers.settings[0].after != STAY and all_are_idle(buffers, w):
        begin_round(world, buffers, templates, w)
    write_observations(world, buffers, w)


@kernel
def restart(world: World, buffers: Buffers, templates: LotTemplates) -> None:
    """Begin a new round in every world."""
    for w in range(world.bodies.shape[0]):
        world.event_counts[w] = 0
        begin_round(world, buffers, templates, w)
        write_observations(world, buffers, w)
