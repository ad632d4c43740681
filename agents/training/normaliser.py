"""Running means of what is seen, cut at a horizon before anything is made of it."""

from typing import Any

import numpy as np
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
            self.obs_rms = _Means(self.horizon, self.observation_space.shape)

    def normalize_obs(self, obs: Any) -> Any:
        """Return observations (n, size) of mean 0 and variance 1."""
        return super().normalize_obs(np.clip(obs, -self.horizon, self.horizon))


class _Means(RunningMeanStd):
    def __init__(self, horizon: np.float32, shape: Any) -> None:
        super().__init__(shape=shape)
        self._horizon = horizon

    def update(self, arr: NDArray[Any]) -> None:
        super().update(np.clip(arr, -self._horizon, self._horizon))
