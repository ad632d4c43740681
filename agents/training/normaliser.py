"""Normalise observations by running means, and decorrelate them."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecEnv, VecNormalize

from race_agents.training.view import ObservationView

Rows = NDArray[Any]

# What varies less never changed, and is left by its mean alone. Divided by next to nothing it would
# saturate its input as soon as it does change, as when a kart that learned alone meets another.
LEAST_VARIANCE = 1e-8


class Normaliser(VecNormalize):
    """SB3's normalisation after an `ObservationView`, with optional decorrelation.

    Neighbouring rays, and a scan and the one before, are nearly equal. Their differences would
    hardly be learned, so `stretch` makes them nearly uncorrelated.
    """

    def __init__(self, karts: VecEnv, view: ObservationView, **options: Any) -> None:
        """Wrap the karts; options are those of `VecNormalize`."""
        super().__init__(karts, **options)
        self.view = view
        means: Any = _Means(view, self.observation_space.shape)
        self.obs_rms = means
        self.stretch: NDArray[np.float64] | None = None  # (size, size)

    def normalize_obs(self, obs: Any) -> Any:
        """Return observations (n, size) as a network takes them, with mean 0 and variance 1.

        Without `norm_obs` a network takes them as they are.
        """
        if not self.norm_obs:
            return self.view(obs).astype(np.float32)
        means: Any = self.obs_rms
        rows = self._normalize_obs(self.view(obs), means)
        return (rows if self.stretch is None else rows @ self.stretch).astype(np.float32)

    def unnormalize_obs(self, obs: Any) -> Any:
        """Return the observations (n, size) that `normalize_obs` turns into these.

        SAC, TD3 and DQN store the last observations of episodes by it.
        """
        if not self.norm_obs:
            return self.view.undone(obs)
        means: Any = self.obs_rms
        rows = obs if self.stretch is None else obs @ np.linalg.inv(self.stretch)
        return self.view.undone(self._unnormalize_obs(rows, means))

    def scaled(self, viewed: Rows) -> NDArray[np.float32]:
        """Return viewed observations (n, size) with mean 0 and variance 1, not decorrelated."""
        means: Any = self.obs_rms
        spread = self.spread_of(means).astype(np.float32)
        rows = (viewed.astype(np.float32) - means.mean.astype(np.float32)) / spread
        return np.clip(rows, -self.clip_obs, self.clip_obs)

    def spread_of(self, means: RunningMeanStd) -> NDArray[np.float64]:
        """Return what numbers are divided by, shape (size,): 1 for those that never changed."""
        changed = means.var > LEAST_VARIANCE
        return np.where(changed, np.sqrt(means.var + self.epsilon), 1.0)

    def _normalize_obs(self, obs: Rows, obs_rms: RunningMeanStd) -> Rows:
        rows = (obs - obs_rms.mean) / self.spread_of(obs_rms)
        return np.clip(rows, -self.clip_obs, self.clip_obs)

    def _unnormalize_obs(self, obs: Rows, obs_rms: RunningMeanStd) -> Rows:
        return obs * self.spread_of(obs_rms) + obs_rms.mean


def state_of(means: RunningMeanStd) -> dict[str, torch.Tensor]:
    """Return running means as tensors, for a checkpoint."""
    numbers = {"mean": means.mean, "variance": means.var, "count": means.count}
    # A plain number would become one of single precision, and means go on from another count.
    return {
        name: torch.as_tensor(value, dtype=torch.float64).clone() for name, value in numbers.items()
    }


def restore_means(means: RunningMeanStd, state: Mapping[str, torch.Tensor]) -> None:
    """Restore running means from a state.

    Raises:
        ValueError: they are of another size.
    """
    mean, variance = state["mean"].numpy(), state["variance"].numpy()
    if np.shape(mean) != np.shape(means.mean):
        raise ValueError(f"means of shape {np.shape(mean)}, expected {np.shape(means.mean)}")
    means.mean, means.var, means.count = mean, variance, float(state["count"])


class _Means(RunningMeanStd):
    def __init__(self, view: ObservationView, shape: Any) -> None:
        # What SB3 counts before the first observation would pass for a variance for long.
        super().__init__(epsilon=1e-12, shape=shape)
        self._view = view

    def update(self, arr: Rows) -> None:
        super().update(self._view(arr))
