"""The critic of a group: what its state is worth, and what it was worth before one agent acted.

The idea is that of MA-POCA: Cohen et al., On the Use and Misuse of Absorbing States in Multi-agent
Reinforcement Learning, 2021, https://arxiv.org/abs/2111.05992. Agents attend to one another, so
their number may change: one that is done is left out, instead of standing for nothing in an
absorbing state.

Axis letters: G groups, L agents of each, S numbers of an observation, A of an action, E of what
stands for an agent.
"""

from collections.abc import Sequence
from math import gcd
from typing import Any

import torch
from stable_baselines3.common.policies import ActorCriticPolicy
from stable_baselines3.common.torch_layers import create_mlp
from torch import nn
from torch.nn import functional

from race_agents.training.reward_wrapper import width_of

HEADS = 4  # of the attention, at most


class GroupCritic(nn.Module):
    """Values and baselines of groups, from the same attention over the agents still active."""

    def __init__(
        self, size: int, width: int, layers: Sequence[int], activation: type[nn.Module]
    ) -> None:
        """Make a network for observations (size,) and actions (width,)."""
        super().__init__()
        embedding, *further = layers
        self.seen = nn.Sequential(nn.Linear(size, embedding), activation())
        self.acted = nn.Sequential(nn.Linear(size + width, embedding), activation())
        self.norm = nn.LayerNorm(embedding)
        self.attention = nn.MultiheadAttention(embedding, gcd(embedding, HEADS), batch_first=True)
        self.head = nn.Sequential(*create_mlp(embedding + 1, 1, list(further), activation))

    def values(self, seen: torch.Tensor, active: torch.Tensor) -> torch.Tensor:
        """Return what the state of each group is worth, shape (G,).

        seen: (G, L, S) observations; active: (G, L), at least one in each group.
        """
        seen = torch.where(active[..., None], seen, 0.0)
        order = _order(seen, active)
        return self._worth(self.seen(_sorted(seen, order)), active.gather(1, order))

    def baselines(
        self, seen: torch.Tensor, acted: torch.Tensor, active: torch.Tensor
    ) -> torch.Tensor:
        """Return what each group is worth given the actions of all agents but one, shape (G, L).

        acted: (G, L, A) actions. In column i the action of agent i is not known; where agent i is
        not active it means nothing.
        """
        both = torch.where(active[..., None], torch.cat([seen, acted], dim=2), 0.0)
        order = _order(both, active)
        both, active = _sorted(both, order), active.gather(1, order)
        agents, size = active.shape[1], seen.shape[2]
        is_own = torch.eye(agents, dtype=torch.bool)[..., None]
        # (G, L, L, E): in row i agent i is what it has seen, the others with what they did.
        told = torch.where(is_own, self.seen(both[..., :size])[:, None], self.acted(both)[:, None])
        worth = self._worth(told.flatten(0, 1), active.repeat_interleave(agents, dim=0))
        return worth.view(-1, agents).gather(1, order.argsort(dim=1))

    def worths(
        self, seen: torch.Tensor, acted: torch.Tensor, active: torch.Tensor
    ) -> tuple[torch.Tensor, torch.Tensor]:
        """Return values (G,) and baselines (G, L): the same, and found once, where L is 1."""
        values = self.values(seen, active)
        if seen.shape[1] == 1:
            return values, values[:, None]
        return values, self.baselines(seen, acted, active)

    def _worth(self, agents: torch.Tensor, active: torch.Tensor) -> torch.Tensor:
        """Return one number for each set of agents (n, L, E), shape (n,)."""
        told = self.norm(agents)
        heard = self._heard(told, active)
        total = torch.where(active[..., None], agents + heard, 0.0).sum(dim=1)
        count = active.sum(dim=1, keepdim=True).to(total.dtype)
        # A mean does not tell of how many it is.
        worth: torch.Tensor = self.head(torch.cat([total / count, count], dim=1))
        return worth.squeeze(1)

    def _heard(self, told: torch.Tensor, active: torch.Tensor) -> torch.Tensor:
        """Return what each agent hears from those of its set, (n, L, E) as what they tell."""
        if told.shape[1] > 1:
            heard, _ = self.attention(
                told, told, told, key_padding_mask=~active, need_weights=False
            )
            return heard
        # One alone hears itself, whatever queries and keys are: two thirds of the work less.
        weight, bias = self.attention.in_proj_weight, self.attention.in_proj_bias
        values = functional.linear(told, weight.chunk(3)[2], bias.chunk(3)[2])
        return self.attention.out_proj(values)


def _order(rows: torch.Tensor, active: torch.Tensor) -> torch.Tensor:
    """Return an order of the agents that does not depend on their numbers, shape (G, L).

    rows: (G, L, n) what is known of each. A sum of floats depends on its order in the last bit, so
    agents are sorted by a number made of their row; those that are not active come last.
    """
    weights = torch.arange(1, rows.shape[2] + 1, dtype=rows.dtype).sqrt()
    keys = torch.where(active, (rows * weights).sum(dim=2), torch.inf)
    return keys.argsort(dim=1, stable=True)


def _sorted(rows: torch.Tensor, order: torch.Tensor) -> torch.Tensor:
    """Return rows (G, L, n) in an order (G, L) of their agents."""
    return rows.gather(1, order[..., None].expand(-1, -1, rows.shape[2]))


class GroupPolicy(ActorCriticPolicy):
    """An actor that all agents share; its value network is the critic of their group."""

    def _build(self, lr_schedule: Any) -> None:
        layers: Any = self.net_arch
        self.net_arch = {"pi": layers, "vf": []}
        super()._build(lr_schedule)
        size, width = width_of(self.observation_space), width_of(self.action_space)
        self.add_module("value_net", GroupCritic(size, width, layers, self.activation_fn))
        # The one that was just made has the parameters of the network before.
        make: Any = self.optimizer_class
        self.optimizer = make(self.parameters(), lr=lr_schedule(1), **self.optimizer_kwargs)

    @property
    def critic(self) -> GroupCritic:
        """The critic of a group."""
        critic: Any = self.value_net
        assert isinstance(critic, GroupCritic)
        return critic
