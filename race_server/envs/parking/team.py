"""The reward of a team: the mean of all, paid until the last of them is done."""

from race_server.core import codes
from race_server.core.kernels.jit import kernel, large_kernel, written_out
from race_server.core.state import World
from race_server.envs.buffers import Buffers
from race_server.envs.decision import all_are_idle
from race_server.envs.observations import write_observation, write_terminal


@large_kernel
def pay_team(world: World, buffers: Buffers, w: int) -> None:
    """Give each learning vehicle of one world the mean of their rewards, and one common end.

    A vehicle that has parked or crashed is paid on, and sees on: its episode ends with that of the
    last, and is cut off if that one is. Comes after each vehicle was judged by itself.
    """
    total, present, drove, is_cut = 0.0, 0, False, False
    for k in range(buffers.rewards.shape[1]):
        if world.bodies[w, k].status != codes.ABSENT:
            present += 1
            total += buffers.rewards[w, k]
            drove = drove or _drove(buffers, w, k)
            is_cut = is_cut or buffers.truncated[w, k] == 1
    if not drove:
        return  # the round is over and waits for a reset
    is_over = all_are_idle(buffers, w)
    for k in range(buffers.rewards.shape[1]):
        if world.bodies[w, k].status != codes.ABSENT:
            _pay(world, buffers, w, k, total / present)
            buffers.terminated[w, k] = 1 if is_over and not is_cut else 0
            buffers.truncated[w, k] = 1 if is_over and is_cut else 0
            if is_over:
                write_terminal(world, buffers, w, k)
                buffers.ended[w, k] = buffers.episodes[w, k]


@kernel
def _drove(buffers: Buffers, w: int, k: int) -> bool:
    """Return whether a vehicle was still on its way when this decision began."""
    ended = buffers.terminated[w, k] + buffers.truncated[w, k]
    return bool(buffers.idle[w, k] == 0 or ended > 0)


@written_out
def _pay(world: World, buffers: Buffers, w: int, k: int, share: float) -> None:
    """Replace the reward of a vehicle for one decision by its share."""
    episode = buffers.episodes[w, k]
    episode.total += share - buffers.rewards[w, k]
    buffers.rewards[w, k] = share
    if not _drove(buffers, w, k):
        episode.steps += 1
        for term in range(buffers.terms.shape[2]):
            buffers.terms[w, k, term] = 0.0
        write_observation(world, buffers, w, k)
