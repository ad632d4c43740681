"""What agents did between two lessons of PPO, without those that wait for others."""

from collections.abc import Generator
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.buffers import RolloutBuffer
from stable_baselines3.common.type_aliases import RolloutBufferSamples


class ActiveRollout(RolloutBuffer):
    """Leaves out what agents decide once their episode is over, until that of the last one is.

    A vehicle that has parked stays in its lot and has no effect there: what it answers to what it
    sees is nothing to learn from.
    """

    def __init__(self, *arguments: Any, world: Any, **options: Any) -> None:
        """Take the arguments of SB3's buffer, and a world with a property `active`, shape (n,)."""
        self._world = world
        super().__init__(*arguments, **options)

    def reset(self) -> None:
        """Forget all decisions."""
        super().reset()
        self.active = np.zeros((self.buffer_size, self.n_envs), np.bool_)
        self._now = self._world.active

    def add(self, *arguments: Any, **options: Any) -> None:
        """Add a decision of all agents, which the world has carried out."""
        self.active[self.pos] = self._now
        super().add(*arguments, **options)
        self._now = self._world.active

    def get(self, batch_size: int | None = None) -> Generator[RolloutBufferSamples, None, None]:
        """Yield the decisions of active agents in random order."""
        assert self.full
        names = ("observations", "actions", "values", "log_probs", "advantages", "returns")
        if not self.generator_ready:
            for name in (*names, "active"):
                setattr(self, name, self.swap_and_flatten(getattr(self, name)))
            self.generator_ready = True
        rows = np.flatnonzero(self.active)
        rows = rows[torch.randperm(len(rows)).numpy()]
        most = batch_size or len(rows)
        for first in range(0, len(rows), most):
            yield self._get_samples(rows[first : first + most])
