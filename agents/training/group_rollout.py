"""What groups of agents did between two lessons, and what it was worth.

Axis letters: T decisions, W groups, L agents of each, S numbers of an observation, A of an action.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.buffers import RolloutBuffer

from race_agents.training.group_critic import GroupCritic
from race_agents.training.reward_wrapper import width_of

Array = NDArray[Any]
GROUPS = 1024  # that a critic judges at a time, so that little memory is needed


class Decision(NamedTuple):
    """One decision of all agents, n = W · L rows; groups are neighbours."""

    seen: Array  # (n, S) before it
    actions: Array  # (n, A) as the actor drew them
    acted: Array  # (n, numbers) what was done, see `reward_wrapper.numbers_of`
    log_probs: Array  # (n,)
    active: Array  # (n,) whether the agent could act
    rewards: Array  # (n,)
    ended: Array  # (n,) whether the agent's episode ended
    infos: Sequence[Mapping[str, Any]]  # (n,) of the vector environment
    active_next: Array  # (n,) after it; where a round is over, in the next one


class GroupBatch(NamedTuple):
    """Some groups at some decisions."""

    seen: torch.Tensor  # (G, L, S)
    actions: torch.Tensor  # (G, L, A)
    acted: torch.Tensor  # (G, L, numbers)
    active: torch.Tensor  # (G, L)
    log_probs: torch.Tensor  # (G, L)
    returns: torch.Tensor  # (G,)
    advantages: torch.Tensor  # (G, L)


class GroupRollout(RolloutBuffer):
    """Decisions of groups; a group is one stream of rewards, also once some have left.

    So an agent that left gets what its group earns afterwards: in the return of its decisions.
    The rewards, values and returns of SB3's buffer are those of groups here, (T, W).
    """

    def __init__(self, *arguments: Any, n_envs: int, agents: int, **options: Any) -> None:
        """Take the arguments of SB3's buffer; `n_envs` agents in groups of `agents`."""
        assert n_envs % agents == 0, f"{n_envs} agents in groups of {agents}"
        self.agents = agents
        self.present = np.zeros(n_envs // agents)  # (W,) agents that the round began with
        options["n_envs"] = n_envs // agents
        super().__init__(*arguments, **options)

    def reset(self) -> None:
        """Forget all decisions."""
        groups = (self.buffer_size, self.n_envs)
        each = (*groups, self.agents)
        self.observations = np.zeros((*each, *self.obs_shape), np.float32)
        self.actions = np.zeros((*each, self.action_dim), np.float32)
        self.acted = np.zeros((*each, width_of(self.action_space)), np.float32)
        self.active = np.zeros(each, np.bool_)
        self.log_probs = np.zeros(each, np.float32)
        for name in ("rewards", "values", "returns", "episode_starts"):
            setattr(self, name, np.zeros(groups, np.float32))
        # (W,) whether the last decision ended the round.
        self._over: Array = np.zeros(self.n_envs, np.bool_)
        # Where time ran out: decision, group, what its agents saw last, and which were active.
        self._cuts: list[tuple[int, int, Array, Array]] = []
        self.pos, self.full = 0, False

    def begin(self, active: Array) -> None:
        """Begin with new rounds in all groups. active: (n,)."""
        self.present = active.reshape(-1, self.agents).sum(axis=1)

    def keep(self, decision: Decision) -> None:
        """Add a decision of all agents."""
        at, shape = self.pos, (self.n_envs, self.agents)
        active = decision.active.reshape(shape)
        self.observations[at] = decision.seen.reshape(*shape, -1)
        self.actions[at] = decision.actions.reshape(*shape, -1)
        self.acted[at] = decision.acted.reshape(*shape, -1)
        self.log_probs[at], self.active[at] = decision.log_probs.reshape(shape), active
        paid = np.where(active, decision.rewards.reshape(shape), 0.0)
        self.rewards[at] = paid.sum(axis=1) / self.present
        self.episode_starts[at] = self._over
        goes_on = active & ~decision.ended.reshape(shape)
        self._over = np.logical_not(goes_on.any(axis=1))
        for group in np.flatnonzero(self._over):
            self._keep_cut(int(group), decision)
        following = decision.active_next.reshape(shape).sum(axis=1)
        self.present = np.where(self._over, following, self.present)
        self.pos += 1
        self.full = self.pos == self.buffer_size

    def _keep_cut(self, group: int, decision: Decision) -> None:
        """Keep what the agents of a group saw last, if time cut its round off."""
        infos = decision.infos[group * self.agents : (group + 1) * self.agents]
        cut = np.array([bool(info.get("TimeLimit.truncated", False)) for info in infos])
        if cut.any():
            last = np.zeros((self.agents, *self.obs_shape), np.float32)
            for agent in np.flatnonzero(cut):
                last[agent] = infos[int(agent)]["terminal_observation"]
            self._cuts.append((self.pos, group, last, cut))

    def conclude(self, critic: GroupCritic, seen: Array, active: Array) -> None:
        """Compute returns (T, W) by TD(lambda), and advantages (T, W, L) over the baselines.

        seen: (n, S) after the last decision; active: (n,) then.
        """
        shape = (self.n_envs, self.agents)
        self.values = _values(critic, self.observations, self.active)
        if self._cuts:
            at, groups, last, cut = (np.array(part) for part in zip(*self._cuts, strict=True))
            self.rewards[at, groups] += self.gamma * _values(critic, last[None], cut[None])[0]
        following = _values(critic, seen.reshape(1, *shape, -1), active.reshape(1, *shape))[0]
        # SB3 fills it with what groups gained over their values, and reckons the returns from that.
        self.advantages = np.zeros_like(self.values)
        self.compute_returns_and_advantage(torch.from_numpy(following), self._over)
        # One agent alone has the group's values as its baselines, see `GroupCritic.worths`.
        alone = self.agents == 1
        baselines = self.values[..., None] if alone else self._baselines(critic)
        self.advantages = self.returns[..., None] - baselines

    def _baselines(self, critic: GroupCritic) -> Array:
        rows = (self.observations, self.acted, self.active)
        parts = zip(*(_parts(row) for row in rows), strict=True)
        with torch.no_grad():
            found = torch.cat([critic.baselines(*part) for part in parts])
        return found.numpy().reshape(self.active.shape)

    def batches(self, groups: int) -> Iterator[GroupBatch]:
        """Yield all decisions in random order, each time those of `groups` groups."""
        assert self.full
        names = ("observations", "actions", "acted", "active", "log_probs", "returns", "advantages")
        flat = [torch.from_numpy(_flat(getattr(self, name))) for name in names]
        for rows in torch.split(torch.randperm(len(flat[0])), groups):
            yield GroupBatch(*(numbers[rows] for numbers in flat))


def _flat(rows: Array) -> Array:
    """Return rows (T, W, …) as (T · W, …)."""
    return rows.reshape(-1, *rows.shape[2:])


def _parts(rows: Array) -> tuple[torch.Tensor, ...]:
    return torch.split(torch.from_numpy(_flat(rows)), GROUPS)


def _values(critic: GroupCritic, seen: Array, active: Array) -> Array:
    """Return values (T, W) of observations (T, W, L, S)."""
    parts = zip(_parts(seen), _parts(active), strict=True)
    with torch.no_grad():
        found = torch.cat([critic.values(*part) for part in parts])
    values: Array = found.numpy().reshape(active.shape[:2])
    return values
