"""Observations of learning karts and their opponents; the reality gap may delay them.

`write_observations` is the observation stage of a discipline whose observations are those of
`race_server.core.observation`. One with observations of another kind fills
`buffers.observations` itself, and then calls `delay_observation`.
"""

from race_server.core.kernels.jit import kernel, large_kernel, written_out
from race_server.core.stages.observe import observe
from race_server.core.state import World
from race_server.envs.buffers import Buffers
from race_server.envs.reality_gap import OBSERVATION_DELAY


@kernel
def write_observations(world: World, buffers: Buffers, w: int) -> None:
    """Fill the observations of one world: of learning karts in an episode, and of opponents.

    Learning karts: `buffers.observations` (W, L, size); opponents: `buffers.views` (W, K, S).
    """
    for k in range(buffers.rewards.shape[1]):
        if buffers.idle[w, k] == 0:
            write_observation(world, buffers, w, k)
    for k in range(buffers.opponent_offsets.shape[0]):
        # A learning kart has a scripted driver, too, where actions are advice to one.
        if buffers.opponent_offsets[k, -1] >= 0:
            _write_view(world, buffers, w, k)


@kernel
def write_observation(world: World, buffers: Buffers, w: int, k: int) -> None:
    """Fill `buffers.observations[w, k]`, (size,), with what a learning kart is to see now."""
    observe(world, w, k, buffers.offsets, buffers.observations[w, k])
    delay_observation(buffers, w, k)


@large_kernel
def write_terminal(world: World, buffers: Buffers, w: int, k: int) -> None:
    """Write the last observation of an episode, and keep it in `buffers.terminal[w, k]`."""
    write_observation(world, buffers, w, k)
    for index in range(buffers.terminal.shape[2]):
        buffers.terminal[w, k, index] = buffers.observations[w, k, index]


@kernel
def delay_observation(buffers: Buffers, w: int, k: int) -> None:
    """Replace what was just observed by what a learning kart saw some decisions before.

    Its reality gap drew the age. A ring, `buffers.late` (W, L, D, size), holds the newest
    observations; without a ring nothing is late.
    """
    depth = buffers.late.shape[2]
    if depth == 0:
        return
    steps = buffers.episodes[w, k].steps
    age = min(int(buffers.draws[w, k, OBSERVATION_DELAY]), steps)
    newest, seen = steps % depth, (steps - age) % depth
    for index in range(buffers.observations.shape[2]):
        buffers.late[w, k, newest, index] = buffers.observations[w, k, index]
        buffers.observations[w, k, index] = buffers.late[w, k, seen, index]


@written_out
def _write_view(world: World, buffers: Buffers, w: int, k: int) -> None:
    """Fill `buffers.views[w, k]`, (S,), with what an opponent sees."""
    observe(world, w, k, buffers.opponent_offsets[k], buffers.row[w])
    for index in range(buffers.row.shape[1]):
        buffers.views[w, k, index] = float(buffers.row[w, index])
