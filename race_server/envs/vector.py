"""Gymnasium's vector environment on a batch: every learning kart is one sub-environment."""

from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from race_server.envs.batch import Batch
from race_server.envs.buffers import REENTER, RESET_WORLD
from race_server.envs.presets import mixed_task, time_trial_task
from race_server.envs.spaces import action_space, observation_space
from race_server.envs.task import Task

Array = NDArray[Any]


def after_an_episode(learners: int) -> int:
    """Return what a batch for a vector environment does with a kart whose episode is over.

    Alone its world begins again; among other learning karts it comes back into the same race. In a
    lot it waits until all are done.
    """
    return RESET_WORLD if learners == 1 else REENTER


class KartVectorEnv(VectorEnv[Array, Array, Array]):
    """W races of L learning karts as W · L sub-environments.

    Autoreset mode: same step. The observation that a step returns for a kart whose episode ended
    is the first of its next one; the last one is in `infos["final_obs"]`.
    """

    metadata = {"autoreset_mode": AutoresetMode.SAME_STEP}

    def __init__(self, task: Task, *, worlds: int = 1, threads: int = 1) -> None:
        """Build the batch.

        Raises:
            ScenarioError, DriverError: the task makes no race.
        """
        learners = task.count_learners()
        self.batch = Batch(task, worlds=worlds, after=after_an_episode(learners), threads=threads)
        self.num_envs = worlds * learners
        self.single_observation_space = observation_space(self.batch.layout)
        self.single_action_space = action_space(task.action)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin new races; with a seed the same ones again. Options are not used."""
        if isinstance(seed, list):
            seed = seed[0]
        self.batch.reset(seed)
        return self._seen(self.batch.observations), {}

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Move every race on by one decision."""
        batch = self.batch
        batch.step(actions)
        ended = batch.terminated.ravel().astype(np.bool_)
        cut = batch.truncated.ravel().astype(np.bool_)
        infos: dict[str, Any] = {}
        over = ended | cut
        if over.any():
            infos["final_obs"] = self._seen(batch.terminal)
            infos["_final_obs"] = over
            for number in np.flatnonzero(over):
                w, k = divmod(int(number), batch.learners)
                infos = self._add_info(infos, {"episode": batch.episode_of(w, k)}, int(number))
        return self._seen(batch.observations), batch.rewards.ravel().copy(), ended, cut, infos

    def _seen(self, observations: Array) -> Array:
        return observations.reshape(self.num_envs, -1).copy()

    def close_extras(self, **_: Any) -> None:
        """End the batch's threads."""
        self.batch.close()


def time_trial_vector(
    num_envs: int = 1, track: str = "covapsy-train-2023", **options: Any
) -> KartVectorEnv:
    """Return `num_envs` karts, each alone on its track."""
    return KartVectorEnv(time_trial_task(track, **options), worlds=num_envs)


def race_vector(
    num_envs: int = 1, track: str = "covapsy-train-2023", karts: int = 8, **options: Any
) -> KartVectorEnv:
    """Return `num_envs` races of one learning kart among scripted ones."""
    return KartVectorEnv(mixed_task(track, karts=karts, **options), worlds=num_envs)
