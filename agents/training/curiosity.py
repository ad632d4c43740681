"""Curiosity: transitions that the model cannot predict yet are rewarded.

An inverse model learns features that tell which action led from one observation to the next; a
forward model predicts the next features. Its error is the reward: Pathak et al., ICML 2017,
https://arxiv.org/abs/1705.05363
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.running_mean_std import RunningMeanStd

from race_agents.training.normaliser import restore_means, state_of
from race_agents.training.reward_wrapper import Rows, RunningScale, network
from race_agents.training.settings import Curiosity


class Curious:
    """A judge that rewards novelty."""

    name = "curiosity"

    def __init__(self, wanted: Curiosity, size: int, width: int, seed: int) -> None:
        """Start untrained. size, width: of an observation and of an action."""
        self._wanted = wanted
        count, hidden = wanted.features, wanted.hidden
        self._features = network((size, hidden, count), seed)
        self._inverse = network((2 * count, hidden, width), seed + 1)
        self._forward = network((count + width, hidden, count), seed + 2)
        self._networks = torch.nn.ModuleList([self._features, self._inverse, self._forward])
        self._optimiser = torch.optim.Adam(self._networks.parameters(), lr=wanted.learning_rate)
        self._scale = RunningScale(size)
        self._usual = RunningMeanStd()
        self._chance = np.random.default_rng(seed)

    def worth(self, seen: Rows, actions: Rows, after: Rows) -> Rows:
        """Return a reward for each transition, shape (n,): the error, or over its running mean."""
        with torch.no_grad():
            error = self._surprise(self._scale(seen), torch.from_numpy(actions), self._scale(after))
        surprise, bonus, most = error.numpy(), self._wanted.bonus, self._wanted.most
        if most is not None:
            return np.asarray(np.minimum(bonus * surprise, most), np.float32)
        self._usual.update(surprise)
        usual = float(self._usual.mean) + 1e-8
        return np.asarray(bonus * np.minimum(surprise / usual, 5.0), np.float32)

    def learn(self, seen: Rows, actions: Rows, after: Rows) -> None:
        """Train the models on transitions of several decisions."""
        self._scale.update(seen)
        before, done, then = self._scale(seen), torch.from_numpy(actions), self._scale(after)
        for rows in np.array_split(
            self._chance.permutation(len(seen)), max(len(seen) // self._wanted.batch_size, 1)
        ):
            inverse = self._guess(before[rows], then[rows]) - done[rows]
            forward = self._surprise(before[rows], done[rows], then[rows]).mean()
            share = self._wanted.forward_share
            loss: Any = share * forward + (1.0 - share) * (inverse**2).mean()
            self._optimiser.zero_grad()
            loss.backward()
            self._optimiser.step()

    def state(self) -> dict[str, Any]:
        """Return networks, optimiser, scale, and the running mean of the error."""
        return {
            "networks": self._networks.state_dict(),
            "optimiser": self._optimiser.state_dict(),
            "scale": self._scale.state(),
            "usual": state_of(self._usual),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a state that `state` returned."""
        self._networks.load_state_dict(state["networks"])
        self._optimiser.load_state_dict(state["optimiser"])
        self._scale.restore(state["scale"])
        restore_means(self._usual, state["usual"])

    def _guess(self, before: torch.Tensor, then: torch.Tensor) -> torch.Tensor:
        """Return the predicted action between two observations."""
        pair = torch.cat([self._features(before), self._features(then)], dim=1)
        return torch.as_tensor(self._inverse(pair))

    def _surprise(
        self, before: torch.Tensor, done: torch.Tensor, then: torch.Tensor
    ) -> torch.Tensor:
        """Return the forward model's error for each transition, shape (n,)."""
        known = torch.cat([self._features(before), done], dim=1)
        return 0.5 * ((self._forward(known) - self._features(then)) ** 2).sum(dim=1)
