"""A vector environment that adds the rewards of a judge to those of the race."""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Any, Protocol

import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecEnv, VecEnvWrapper

from race_agents.training.normaliser import restore_means, state_of

Rows = NDArray[np.float32]


class Judge(Protocol):
    """Rewards transitions, and learns from them."""

    name: str  # in a checkpoint

    def worth(self, seen: Rows, actions: Rows, after: Rows) -> Rows:
        """Return a reward for each transition, shape (n,).

        seen, after: (n, size) observations before and after the actions (n, A).
        """

    def learn(self, seen: Rows, actions: Rows, after: Rows) -> None:
        """Learn from transitions of several decisions."""

    def state(self) -> dict[str, Any]:
        """Return all that was learned, networks and optimisers, as tensors and plain data."""

    def restore(self, state: Mapping[str, Any]) -> None:
        """Restore a state that `state` returned."""


class RewardWrapper(VecEnvWrapper):
    """Adds the reward of a judge to a share of the race's own reward."""

    def __init__(self, world: VecEnv, judge: Judge, *, own_share: float, decisions: int) -> None:
        """Add a judge to a world; it learns every `horizon` decisions of each kart."""
        super().__init__(world)
        self.judge = judge
        self._own_share = own_share
        self._decisions = decisions
        self._seen: Rows = np.zeros(0, np.float32)
        self._actions: Rows = np.zeros(0, np.float32)
        self._kept: list[tuple[Rows, Rows, Rows]] = []

    def reset(self) -> Any:
        """Start new races and return the observations of all karts."""
        self._seen = np.asarray(self.venv.reset())
        return self._seen

    def step_async(self, actions: NDArray[Any]) -> None:
        """Take the actions of all karts."""
        self._actions = numbers_of(actions, self.action_space)
        super().step_async(actions)

    def step_wait(self) -> Any:
        """Step every race by one decision."""
        seen, rewards, dones, infos = self.venv.step_wait()
        after = np.array(seen)
        for number in np.flatnonzero(dones):
            after[number] = infos[number]["terminal_observation"]
        transition = (self._seen, self._actions, after)
        worth = self.judge.worth(*transition)
        self._kept.append(transition)
        if len(self._kept) >= self._decisions:
            parts = [np.concatenate(part) for part in zip(*self._kept, strict=True)]
            self.judge.learn(*parts)
            self._kept.clear()
        self._seen = np.asarray(seen)
        return seen, self._own_share * rewards + worth, dones, infos


def numbers_of(actions: NDArray[Any], space: spaces.Space[Any]) -> Rows:
    """Return actions as numbers, shape (n, A); a discrete one is 1 in its column."""
    if isinstance(space, spaces.Discrete):
        return np.eye(int(space.n), dtype=np.float32)[np.asarray(actions, np.int64).ravel()]
    return np.asarray(actions, np.float32).reshape(len(actions), -1)


def width_of(space: Any) -> int:
    """Return the number of columns of `numbers_of`."""
    return int(space.n) if isinstance(space, spaces.Discrete) else int(space.shape[0])


def network(sizes: Sequence[int], seed: int) -> torch.nn.Sequential:
    """Return layers of these sizes with tanh between them; the seed decides all weights."""
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        layers: list[torch.nn.Module] = []
        for before, after in pairwise(sizes):
            layers += [torch.nn.Linear(before, after), torch.nn.Tanh()]
    return torch.nn.Sequential(*layers[:-1])


class RunningScale:
    """Running means that scale rows to a mean of zero and a deviation of one."""

    def __init__(self, size: int) -> None:
        """Start without data."""
        self._numbers = RunningMeanStd(shape=(size,))

    def state(self) -> dict[str, torch.Tensor]:
        """Return the means as tensors."""
        return state_of(self._numbers)

    def restore(self, state: Mapping[str, torch.Tensor]) -> None:
        """Restore a state that `state` returned."""
        restore_means(self._numbers, state)

    def update(self, rows: Rows) -> None:
        """Update the means with rows, shape (n, size)."""
        self._numbers.update(rows)

    def __call__(self, rows: Rows) -> torch.Tensor:
        """Return rows, scaled and clipped to five deviations."""
        scaled = (rows - self._numbers.mean) / np.sqrt(self._numbers.var + 1e-4)
        return torch.from_numpy(np.clip(scaled, -5.0, 5.0).astype(np.float32))
