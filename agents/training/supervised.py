"""Supervised learning: fit the answers of a network to those of a teacher or a demonstration."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from torch.nn import functional

from race_agents.training.normaliser import Normaliser
from race_agents.training.warm_start_settings import WarmStart

Array = NDArray[np.float32]


class Memory:
    """Pairs of viewed observation and action; new ones overwrite the oldest."""

    def __init__(self, capacity: int, size: int, width: int) -> None:
        """Allocate pairs of an observation (size,) and an action (width,)."""
        self._seen = np.zeros((capacity, size), np.float32)
        self._labels = np.zeros((capacity, width), np.float32)
        self.count = 0  # of all pairs so far, those that were overwritten included

    def add(self, seen: Array, labels: Array) -> None:
        """Store pairs, shapes (n, size) and (n, width)."""
        capacity = len(self._seen)
        for first in range(0, len(seen), capacity):
            part = slice(first, first + capacity)
            places = (self.count + np.arange(len(seen[part]))) % capacity
            self._seen[places], self._labels[places] = seen[part], labels[part]
            self.count += len(places)

    def draw(self, count: int, chance: np.random.Generator) -> tuple[Array, Array]:
        """Return `count` random pairs."""
        rows = chance.integers(0, min(self.count, len(self._seen)), count)
        return self._seen[rows], self._labels[rows]


class SupervisedSteps:
    """Regression of an actor's answers."""

    def __init__(
        self, wanted: WarmStart, learner: PPO, world: Normaliser, weights: Array, quantiles: Array
    ) -> None:
        """Prepare the optimiser.

        weights: (A,) of the error of each number of an action; quantiles: (A,) weight of an error
        if the answer is too low, one less it if too high.
        """
        policy: Any = learner.policy
        self._wanted = wanted
        self._world = world
        self._weights, self._quantiles = torch.from_numpy(weights), torch.from_numpy(quantiles)
        self._net = torch.nn.Sequential(policy.mlp_extractor.policy_net, policy.action_net)
        self._first: torch.nn.Linear = policy.mlp_extractor.policy_net[0]
        self._optimiser = torch.optim.Adam(self._net.parameters(), lr=wanted.learning_rate)
        space: Any = world.action_space
        self._low, self._high = torch.from_numpy(space.low), torch.from_numpy(space.high)

    def look_at(self, viewed: Array) -> None:
        """Measure how to decorrelate the inputs; no answer changes by it."""
        rows = self._world.scaled(viewed).astype(np.float64)
        size = rows.shape[1]
        before = np.eye(size) if self._world.stretch is None else self._world.stretch
        spread = np.cov(rows.T) + self._wanted.floor * np.eye(size)
        values, directions = np.linalg.eigh(spread)
        # In the precision of a policy file.
        stretch = (directions @ np.diag(values**-0.5) @ directions.T).astype(np.float32)
        self._world.stretch = stretch.astype(np.float64)
        change = before @ directions @ np.diag(values**0.5) @ directions.T
        with torch.no_grad():
            self._first.weight.copy_(self._first.weight.double() @ torch.from_numpy(change))

    def answer(self, seen: Array) -> Array:
        """Return the actor's own actions, shape (n, A)."""
        with torch.no_grad():
            rows = torch.from_numpy(self._world.normalize_obs(seen))
            return self._limited(self._net(rows)).numpy()

    def learn(self, viewed: Array, labels: Array, elapsed: float) -> Array:
        """Take one step towards the labels; return the mean error of each number, shape (A,).

        viewed: (n, size) observations as the world's view shows them; elapsed: share of the warm
        start, by which the learning rate falls.
        """
        first, last = self._wanted.learning_rate, self._wanted.last_learning_rate
        for group in self._optimiser.param_groups:
            group["lr"] = first + elapsed * (last - first)
        wanted = torch.from_numpy(labels)
        answers = self._net(self._stretched(viewed))
        # Beyond a limit an answer has the same effect as at it, and is not wrong.
        beyond = ((wanted >= self._high) & (answers > self._high)) | (
            (wanted <= self._low) & (answers < self._low)
        )
        losses = loss_of(self._wanted.loss, answers, wanted, self._quantiles)
        errors = torch.where(beyond, 0.0, losses).mean(dim=0)
        self._optimiser.zero_grad()
        loss: Any = (errors * self._weights).sum()
        loss.backward()
        self._optimiser.step()
        with torch.no_grad():
            return (self._limited(answers) - wanted).abs().mean(dim=0).numpy()

    def _stretched(self, viewed: Array) -> torch.Tensor:
        rows, stretch = self._world.scaled(viewed), self._world.stretch
        return torch.from_numpy(rows if stretch is None else rows @ stretch.astype(np.float32))

    def _limited(self, answers: torch.Tensor) -> torch.Tensor:
        return torch.minimum(torch.maximum(answers, self._low), self._high)


def loss_of(
    kind: str, answers: torch.Tensor, wanted: torch.Tensor, quantiles: torch.Tensor
) -> torch.Tensor:
    """Return the loss of each answer, shape (..., A).

    kind: one of `WarmStart.loss`; quantiles: (A,), 0.5 weighs both sides of what is wanted by 1.
    Of several answers that fit, absolute errors lead to their quantile: Koenker and Bassett,
    Econometrica 46, 1978; squared ones to their expectile: Newey and Powell, Econometrica 55, 1987.
    """
    side = 2.0 * torch.where(answers < wanted, quantiles, 1.0 - quantiles)
    if kind == "squared":
        return side * (answers - wanted) ** 2
    if kind == "absolute":
        return side * (answers - wanted).abs()
    return side * functional.huber_loss(answers, wanted, reduction="none", delta=0.3)
