"""One decision of every world, in order: the training world's counterpart of `core/step.py`."""

from race_server.core import codes
from race_server.core.clock import TICK_S
from race_server.core.kernels.jit import kernel, large_kernel
from race_server.core.stages.controls import take_controls
from race_server.core.stages.observe import observe
from race_server.core.state import World
from race_server.core.step import step
from race_server.envs.actions import Driven, read_action
from race_server.envs.buffers import REENTER, RESET_WORLD, Buffers, Templates
from race_server.envs.reality_gap import ACTION_DELAY, apply_lag_and_backlash
from race_server.envs.reset import begin_round, reenter, write_observation
from race_server.envs.reward_terms import reward_terms, snapshot_counters


@kernel
def decide(world: World, rig: Buffers, templates: Templates) -> None:
    """Move every world on by one decision: actions in, observations, rewards and ends out."""
    settings = rig.settings[0]
    for w in range(world.bodies.shape[0]):
        world.event_counts[w] = 0
        for k in range(rig.rewards.shape[1]):
            _command(world, rig, w, k)
        snapshot_counters(world, rig, w)
        take_controls(world, w, rig.controls[w])
        for _ in range(settings.decision_ticks):
            step(world, w)
        rig.rounds[w].steps += 1
        for k in range(rig.rewards.shape[1]):
            _conclude(world, rig, w, k)
        _begin_anew(world, rig, templates, w)
        write_all_observations(world, rig, w)


@kernel
def restart(world: World, rig: Buffers, templates: Templates) -> None:
    """Begin a new round in every world."""
    for w in range(world.bodies.shape[0]):
        world.event_counts[w] = 0
        begin_round(world, rig, templates, w)
        write_all_observations(world, rig, w)


@kernel
def _command(world: World, rig: Buffers, w: int, k: int) -> None:
    """Turn one kart's action into a control: delayed, late and loose as its reality gap says."""
    settings, control = rig.settings[0], rig.controls[w, k]
    memory, draws = rig.commanded[w, k], rig.draws[w, k]
    body, racer, player = world.bodies[w, k], world.racers[w, k], world.players[w, k]
    kart, vehicle = (
        Driven(body.speed, player.buttons_before, racer.rescue_offered),
        world.vehicles[w, k],
    )
    read_action(settings.action, rig.actions[w, k], rig.table, kart, vehicle, memory, control)
    depth = rig.delayed.shape[2]
    if depth > 0:
        steps = rig.episodes[w, k].steps
        for index in range(4):
            rig.delayed[w, k, steps % depth, index] = control[index]
        age = int(draws[ACTION_DELAY])
        for index in range(4):
            # Before the first action arrives nothing is commanded.
            late = rig.delayed[w, k, (steps - age) % depth, index] if age <= steps else 0.0
            control[index] = late
    apply_lag_and_backlash(draws, memory, settings.decision_ticks * TICK_S, control)


@kernel
def _conclude(world: World, rig: Buffers, w: int, k: int) -> None:
    rig.terminated[w, k] = 0
    rig.truncated[w, k] = 0
    rig.rewards[w, k] = 0.0
    if rig.idle[w, k]:
        return
    reward_terms(world, rig, w, k)
    if rig.terminated[w, k] or rig.truncated[w, k]:
        rig.idle[w, k] = 1
        rig.ended[w, k] = rig.episodes[w, k]
        write_observation(world, rig, w, k)
        for index in range(rig.terminal.shape[2]):
            rig.terminal[w, k, index] = rig.observations[w, k, index]


@kernel
def _begin_anew(world: World, rig: Buffers, templates: Templates, w: int) -> None:
    """Reset what is over, as the settings want it."""
    after = rig.settings[0].after
    if after == RESET_WORLD:
        for k in range(rig.rewards.shape[1]):
            if rig.idle[w, k] == 0:
                return
        begin_round(world, rig, templates, w)
    elif after == REENTER:
        if world.races[w].over:
            # The clock of the race ran out, or nobody is left in it.
            begin_round(world, rig, templates, w)
            return
        learners = rig.rewards.shape[1]
        for k in range(world.bodies.shape[1]):
            status = world.bodies[w, k].status
            over = rig.idle[w, k] == 1 if k < learners else status != codes.RACING
            if over and status != codes.ABSENT:
                reenter(world, rig, templates, w, k)


@kernel
def write_all_observations(world: World, rig: Buffers, w: int) -> None:
    """Fill the observations of the learning karts and of the scripted drivers."""
    learners = rig.rewards.shape[1]
    for k in range(learners):
        if rig.idle[w, k] == 0:
            write_observation(world, rig, w, k)
    for k in range(world.bodies.shape[1]):
        # A learning kart has a scripted driver, too, where actions are advice to one.
        if rig.opponent_parts[k, 0] >= 0:
            _show_opponent(world, rig, w, k)


@large_kernel
def _show_opponent(world: World, rig: Buffers, w: int, k: int) -> None:
    observe(world, w, k, rig.opponent_parts[k], rig.row[w])
    for index in range(rig.row.shape[1]):
        rig.views[w, k, index] = float(rig.row[w, index])
