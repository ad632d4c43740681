"""Stages of a decision that every discipline shares: from actions to controls, from terms to ends.

A discipline's `decide` calls them in order, see `envs/racing/decide.py`.
"""

from race_server.core.clock import TICK_S
from race_server.core.kernels.jit import kernel
from race_server.core.state import World
from race_server.envs.actions import Driven, read_action
from race_server.envs.buffers import Buffers
from race_server.envs.reality_gap import ACTION_DELAY, apply_lag_and_backlash


@kernel
def command_learners(world: World, buffers: Buffers, w: int) -> None:
    """Fill the controls of one world's learning karts from their actions.

    `buffers.controls` (W, K, 4): steering [-1, 1], throttle [-1, 1], brake [0, 1], buttons.
    """
    for k in range(buffers.rewards.shape[1]):
        _command(world, buffers, w, k)


@kernel
def _command(world: World, buffers: Buffers, w: int, k: int) -> None:
    """Turn one kart's action into a control; its reality gap delays, damps and loosens it."""
    settings, control = buffers.settings[0], buffers.controls[w, k]
    memory, draws = buffers.commanded[w, k], buffers.draws[w, k]
    body, racer, player = world.bodies[w, k], world.racers[w, k], world.players[w, k]
    kart = Driven(body.speed, player.buttons_before, racer.rescue_offered)
    action, vehicle = buffers.actions[w, k], world.vehicles[w, k]
    read_action(settings.action, action, buffers.table, kart, vehicle, memory, control)
    depth = buffers.delayed.shape[2]
    if depth > 0:
        steps = buffers.episodes[w, k].steps
        for index in range(4):
            buffers.delayed[w, k, steps % depth, index] = control[index]
        age = int(draws[ACTION_DELAY])
        for index in range(4):
            # Before the first action arrives nothing is commanded.
            late = buffers.delayed[w, k, (steps - age) % depth, index] if age <= steps else 0.0
            control[index] = late
    apply_lag_and_backlash(draws, memory, settings.decision_ticks * TICK_S, control)


@kernel
def clear_outcome(buffers: Buffers, w: int, k: int) -> bool:
    """Clear the result of the last decision; return whether the kart's episode continues."""
    buffers.terminated[w, k] = 0
    buffers.truncated[w, k] = 0
    buffers.rewards[w, k] = 0.0
    return buffers.idle[w, k] == 0


@kernel
def weigh_terms(buffers: Buffers, w: int, k: int) -> None:
    """Add up reward and episode of one learning kart from its terms, (T,) in `buffers.terms`."""
    episode, reward = buffers.episodes[w, k], 0.0
    for term in range(len(buffers.weights)):
        reward += buffers.weights[term] * buffers.terms[w, k, term]
    buffers.rewards[w, k] = reward
    episode.total += reward
    episode.steps += 1


@kernel
def close_episode(buffers: Buffers, w: int, k: int, is_over: bool, is_late: bool) -> bool:
    """Mark a learning kart's episode as terminated or truncated; return whether it is either.

    is_over: its own end has come; is_late: time has run out. An episode is also cut off after
    `settings.most_steps` decisions.
    """
    most_steps = buffers.settings[0].most_steps
    if is_over:
        buffers.terminated[w, k] = 1
    elif is_late or 0 < most_steps <= buffers.episodes[w, k].steps:
        buffers.truncated[w, k] = 1
    else:
        return False
    buffers.idle[w, k] = 1
    buffers.ended[w, k] = buffers.episodes[w, k]
    return True


@kernel
def all_are_idle(buffers: Buffers, w: int) -> bool:
    """Return whether the episodes of all learning karts of one world are over."""
    for k in range(buffers.rewards.shape[1]):
        if buffers.idle[w, k] == 0:
            return False
    return True
