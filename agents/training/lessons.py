"""Lessons: a network's answers are drawn towards those that a teacher or a demonstration gave."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize
from torch.nn import functional

from agents.training.settings import WarmStart

Array = NDArray[np.float32]


class Memory:
    """What was seen and what was to be done then; the newest takes the place of the oldest."""

    def __init__(self, capacity: int, size: int, width: int) -> None:
        """Make room for pairs of an observation (size,) and an action (width,)."""
        self._seen = np.zeros((capacity, size), np.float32)
        self._labels = np.zeros((capacity, width), np.float32)
        self.count = 0  # of all pairs so far, those that were overwritten included

    def add(self, seen: Array, labels: Array) -> None:
        """Keep pairs, shapes (n, size) and (n, width)."""
        capacity = len(self._seen)
        for first in range(0, len(seen), capacity):
            part = slice(first, first + capacity)
            places = (self.count + np.arange(len(seen[part]))) % capacity
            self._seen[places], self._labels[places] = seen[part], labels[part]
            self.count += len(places)

    def draw(self, count: int, chance: np.random.Generator) -> tuple[Array, Array]:
        """Return so many pairs by lot."""
        rows = chance.integers(0, min(self.count, len(self._seen)), count)
        return self._seen[rows], self._labels[rows]


class Lessons:
    """Regression of an actor's mean answer."""

    def __init__(
        self, wanted: WarmStart, learner: PPO, world: VecNormalize, weights: Array
    ) -> None:
        """Get ready. weights: (A,) how much an error of each number of an action counts."""
        policy: Any = learner.policy
        self._wanted = wanted
        self._world = world
        self._weights = torch.from_numpy(weights)
        self._net = torch.nn.Sequential(policy.mlp_extractor.policy_net, policy.action_net)
        self._first: torch.nn.Linear = policy.mlp_extractor.policy_net[0]
        self._stretch = self._shrink = torch.eye(self._first.in_features)
        self._optimiser = torch.optim.Adam(self._net.parameters(), lr=wanted.learning_rate)
        space: Any = world.action_space
        self._low, self._high = torch.from_numpy(space.low), torch.from_numpy(space.high)

    def look_at(self, seen: Array) -> None:
        """Find out how inputs are stretched until they are as good as uncorrelated.

        Neighbouring rays, and a scan and the one before, tell nearly the same; what tells them
        apart would hardly be learned.
        """
        rows = self._scaled(seen)
        spread = torch.cov(rows.T) + self._wanted.floor * torch.eye(rows.shape[1])
        values, directions = torch.linalg.eigh(spread)
        self._stretch = directions @ torch.diag(values.rsqrt()) @ directions.T
        self._shrink = directions @ torch.diag(values.sqrt()) @ directions.T

    @contextmanager
    def stretched(self) -> Iterator[None]:
        """Learn on stretched inputs: the first layer is changed so that no answer changes."""
        self._change_first(self._shrink)
        yield
        self._change_first(self._stretch)

    def _change_first(self, change: torch.Tensor) -> None:
        with torch.no_grad():
            self._first.weight.copy_(self._first.weight @ change)

    def answer(self, seen: Array) -> Array:
        """Return the actor's own actions, shape (n, A)."""
        with torch.no_grad():
            return self._limited(self._net(self._scaled(seen))).numpy()

    def learn(self, seen: Array, labels: Array, elapsed: float) -> Array:
        """Take one step towards the labels; return the mean error of each number, shape (A,).

        Within `stretched`. elapsed: share of the warm start, by which the learning rate falls.
        """
        first, last = self._wanted.learning_rate, self._wanted.last_learning_rate
        for group in self._optimiser.param_groups:
            group["lr"] = first + elapsed * (last - first)
        wanted = torch.from_numpy(labels)
        answers = self._net(self._scaled(seen) @ self._stretch)
        # Beyond a limit an answer does the same as at it, and is not wrong.
        beyond = ((wanted >= self._high) & (answers > self._high)) | (
            (wanted <= self._low) & (answers < self._low)
        )
        errors = torch.where(beyond, 0.0, self._errors(answers, wanted)).mean(dim=0)
        self._optimiser.zero_grad()
        loss: Any = (errors * self._weights).sum()
        loss.backward()
        self._optimiser.step()
        with torch.no_grad():
            return (self._limited(answers) - wanted).abs().mean(dim=0).numpy()

    def _errors(self, answers: torch.Tensor, wanted: torch.Tensor) -> torch.Tensor:
        if self._wanted.loss == "squared":
            return (answers - wanted) ** 2
        if self._wanted.loss == "absolute":
            return (answers - wanted).abs()
        return functional.huber_loss(answers, wanted, reduction="none", delta=0.3)

    def _limited(self, answers: torch.Tensor) -> torch.Tensor:
        return torch.minimum(torch.maximum(answers, self._low), self._high)

    def _scaled(self, seen: Array) -> torch.Tensor:
        return torch.from_numpy(np.asarray(self._world.normalize_obs(seen), np.float32))
