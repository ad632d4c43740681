"""Running means of what is seen, cut at a horizon before anything is made of it."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecEnv, VecNormalize


class Normaliser(VecNormalize):
    """SB3's, but for the cut: numbers beyond the horizon count as the horizon.

    Where nobody is near an observation says 1000 m. That would be most of the variance, and a
    kart at 1 m would look like one at 5 m.
    """

    def __init__(self, karts: VecEnv, horizon: float | None, **options: Any) -> None:
        """Wrap the karts; options are those of `VecNormalize`."""
        super().__init__(karts, **options)
        self.horizon = np.float32(np.inf if horizon is None else horizon)
        if horizon is not None:
            means: Any = _Means(self.horizon, self.observation_space.shape)
            self.obs_rms = means

    def normalize_obs(self, obs: Any) -> Any:
        """Return observations (n, size) of mean 0 and variance 1."""
        return super().normalize_obs(np.clip(obs, -self.horizon, self.horizon))


def state_of(means: RunningMeanStd) -> dict[str, torch.Tensor]:
    """Return running means as tensors, for a checkpoint."""
    numbers = {"mean": means.mean, "variance": means.var, "count": means.count}
    return {name: torch.as_tensor(value).clone() for name, value in numbers.items()}


def put_back(means: RunningMeanStd, state: Mapping[str, torch.Tensor]) -> None:
    """Let running means be what they were when `state` was taken.

    Raises:
        ValueError: they are of another size.
    """
    mean, variance = state["mean"].numpy(), state["variance"].numpy()
    if np.shape(mean) != np.shape(means.mean):
        raise ValueError(f"means of shape {np.shape(mean)}, {np.shape(means.mean)} are wanted")
    means.mean, means.var, means.count = mean, variance, float(state["count"])


class _Means(RunningMeanStd):
    def __init__(self, horizon: np.float32, shape: Any) -> None:
        super().__init__(shape=shape)
        self._horizon = horizon

    def update(self, arr: NDArray[Any]) -> None:
        super().update(np.clip(arr, -self._horizon, self._horizon))
