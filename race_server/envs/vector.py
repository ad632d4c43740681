"""Gymnasium's vector environment on a batch: every learning kart is one sub-environment."""

from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from race_server.envs.batch import Batch
from race_server.envs.buffers import REENTER, RESET_WORLD, STAY
from race_server.envs.camera import VECTOR_RENDER_MODES, VectorCamera
from race_server.envs.presets import mixed_task, time_trial_task
from race_server.envs.saved_state import own_part_in
from race_server.envs.spaces import action_space, masks_for, observation_space
from race_server.envs.task import Task
from race_server.errors import ScenarioError

Array = NDArray[Any]
SAME_STEP, NEXT_STEP, DISABLED = (
    AutoresetMode.SAME_STEP,
    AutoresetMode.NEXT_STEP,
    AutoresetMode.DISABLED,
)


def after_an_episode(learners: int) -> int:
    """Return what a batch for a vector environment does with a kart whose episode is over.

    Alone its world begins again; among other learning karts it comes back into the same race. In a
    lot it waits until all are done.
    """
    return RESET_WORLD if learners == 1 else REENTER


class KartVectorEnv(VectorEnv[Array, Array, Array]):
    """W races of L learning karts as W · L sub-environments.

    Same step: the observation that a step returns for a kart whose episode ended is the first of
    its next one; the last one is in `infos["final_obs"]`. Next step, and disabled: the last one is
    returned, and the next step, or a reset with `options={"reset_mask": ...}`, gives the first of
    another. Figures of an episode that ended are under the key of the discipline, `lap_times` in a
    race, each an array (n,).

    Where several vehicles of a lot learn, one that is done stays in the vector, its actions without
    effect, until all of its lot are done; the step that ends the last episode returns the first
    observations of all. `infos["idle"]`, booleans (n,), is true for a vehicle that was done before
    the step: that step belongs to no episode of it. In a team none is idle, as all are paid until
    the last is done.
    """

    def __init__(
        self,
        task: Task,
        *,
        worlds: int = 1,
        threads: int = 1,
        autoreset_mode: AutoresetMode | str = SAME_STEP,
        render_mode: str | None = None,
    ) -> None:
        """Build the batch.

        autoreset_mode: Gymnasium's, where one kart learns in each race; where several do, a kart
        comes back at the same step. render_mode: None or rgb_array, one picture for each
        sub-environment.

        Raises:
            ScenarioError, DriverError: the task makes no race, or the modes do not exist.
        """
        learners = task.count_learners()
        self.autoreset_mode = _mode(autoreset_mode, learners)
        after = after_an_episode(learners) if self.autoreset_mode is SAME_STEP else STAY
        self.batch = Batch(task, worlds=worlds, seed=None, after=after, threads=threads)
        self.num_envs = worlds * learners
        self.single_observation_space = observation_space(self.batch.layout)
        self.single_action_space = action_space(task.action)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)
        self.action_space = batch_space(self.single_action_space, self.num_envs)
        self.metadata: dict[str, Any] = {
            "autoreset_mode": self.autoreset_mode,
            "render_modes": list(VECTOR_RENDER_MODES),
            "render_fps": task.decisions_per_s,
        }
        self.render_mode = render_mode
        self._camera = VectorCamera(self.batch, render_mode)
        self._over = np.zeros(self.num_envs, np.bool_)  # episodes that ended with the last step

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Array, dict[str, Any]]:
        """Begin new races; with a seed the same ones again, with a list each its own.

        options: as for `Batch.reset`; `reset_mask`, booleans (n,), leaves the others as they are.

        Raises:
            ScenarioError: the task has not what the options ask for.
        """
        wanted = dict(options or {})
        mask = wanted.pop("reset_mask", None)
        worlds = None if mask is None else self._worlds_of(mask)
        if isinstance(seed, list) and len(seed) != self.num_envs:
            raise ScenarioError(f"{len(seed)} seeds for {self.num_envs} environments: give as many")
        if isinstance(seed, list):
            # Karts of one race share its seed: that of the first.
            seed = seed[:: self.batch.learners]
            seed = seed if worlds is None else [seed[w] for w in worlds]
        self.batch.reset(seed, wanted, worlds)
        over = self._over_in(own_part_in(wanted))
        self._over[:] = over if mask is None else np.where(mask, over, self._over)
        return self._seen(self.batch.observations), {}

    def _worlds_of(self, mask: Any) -> list[int]:
        """Return the worlds of sub-environments that a mask (n,) names."""
        chosen = np.asarray(mask)
        if chosen.dtype != np.bool_ or chosen.shape != (self.num_envs,) or not chosen.any():
            raise ScenarioError(
                f"reset_mask of {chosen.dtype}, shape {chosen.shape}: give {self.num_envs} "
                "booleans, one of them true"
            )
        if self.batch.learners > 1:
            raise ScenarioError(
                f"reset_mask where {self.batch.learners} karts learn in each race: they come back "
                "by themselves; reset all"
            )
        return [int(w) for w in np.flatnonzero(chosen)]

    def step(self, actions: Array) -> tuple[Array, Array, Array, Array, dict[str, Any]]:
        """Move every race on by one decision.

        Raises:
            ScenarioError: actions have another shape or are no numbers, or, where nothing begins
                by itself, an episode is over.
        """
        batch, begun = self.batch, np.flatnonzero(self._over)
        waits = self._waits()
        if len(begun) and self.autoreset_mode is DISABLED:
            raise ScenarioError(
                f"environment {int(begun[0])}: its episode is over; reset it with "
                "options={'reset_mask': ...}"
            )
        batch.step(actions)
        if len(begun) and self.autoreset_mode is NEXT_STEP:
            batch.reset(worlds=begun.tolist())
        ended = batch.terminated.ravel().astype(np.bool_)
        cut = batch.truncated.ravel().astype(np.bool_)
        over = ended | cut
        infos = self._last_words(over) if over.any() else {}
        if batch.learners > 1:
            infos |= {"idle": waits, "_idle": np.ones(self.num_envs, np.bool_)}
        if self.autoreset_mode is not SAME_STEP:
            self._over = over
        return self._seen(batch.observations), batch.rewards.ravel().copy(), ended, cut, infos

    def _waits(self) -> Array:
        """Return who waits until all others of its lot are done, and is not paid, (n,)."""
        is_team = self.batch.task.discipline.settings.get("team", 0.0)
        return self.batch.buffers.idle.ravel().astype(np.bool_) & (not is_team)

    def _last_words(self, over: Array) -> dict[str, Any]:
        """Return what is told of episodes that have just ended. over: booleans (n,)."""
        batch, key = self.batch, self.batch.task.discipline.outcome
        infos: dict[str, Any] = {}
        for number in np.flatnonzero(over).tolist():
            w, k = divmod(number, batch.learners)
            told: dict[str, Any] = {key: batch.episode_of(w, k)}
            if self.autoreset_mode is SAME_STEP:
                told["final_obs"] = batch.terminal[w, k].copy()
                told["final_info"] = {key: told[key]}
            infos = self._add_info(infos, told, number)
        return infos

    def _seen(self, observations: Array) -> Array:
        return observations.reshape(self.num_envs, -1).copy()

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which discrete actions of each kart count, shape (n, 15)."""
        return masks_for(self.single_action_space, self.batch.buffers.idle.ravel())

    def save_state(self) -> bytes:
        """Return the state of all races, see `Batch.save_state`."""
        return self.batch.save_state(own=self._over.tobytes())

    def load_state(self, state: bytes) -> Array:
        """Put all races into a saved state, of as many or of one; return the observations."""
        self._over[:] = self._over_in(self.batch.load_state(state))
        return self._seen(self.batch.observations)

    def _over_in(self, own: bytes) -> Array:
        """Return which episodes were over, (n,), as `save_state` added it."""
        return np.frombuffer(own if len(own) == self.num_envs else bytes(self.num_envs), np.bool_)

    def render(self) -> tuple[Array, ...] | None:
        """Return a picture of the race of each sub-environment, (height, width, 3) bytes."""
        return self._camera.shoot_all()

    def close_extras(self, **_: Any) -> None:
        """End the batch's threads."""
        self.batch.close()


def _mode(wanted: AutoresetMode | str, learners: int) -> AutoresetMode:
    try:
        mode = AutoresetMode(wanted)
    except ValueError as error:
        known = ", ".join(each.value for each in AutoresetMode)
        raise ScenarioError(f"autoreset mode {wanted!r} is unknown; choose of {known}") from error
    if mode is not SAME_STEP and learners > 1:
        raise ScenarioError(
            f"autoreset mode {mode.value} with {learners} learning karts in each race: one that is "
            f"done comes back while the others race on; choose {SAME_STEP.value}, or one learner"
        )
    return mode


def vector_of(task: Task, num_envs: int, options: Mapping[str, Any]) -> KartVectorEnv:
    """Return a vector of `num_envs` learning karts. options: as for `KartVectorEnv`.

    Raises:
        ScenarioError: the number is not a multiple of the learning karts of a race.
    """
    learners = task.count_learners()
    if num_envs < 1 or num_envs % learners:
        raise ScenarioError(
            f"num_envs = {num_envs} with {learners} learning karts in each race: choose a multiple "
            f"of {learners}"
        )
    return KartVectorEnv(task, worlds=num_envs // learners, **options)


def split_options(options: Mapping[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what of some options is for a task, and what is for `KartVectorEnv`."""
    own = {"threads", "autoreset_mode", "render_mode"}
    ours = {name: value for name, value in options.items() if name in own}
    return {name: value for name, value in options.items() if name not in own}, ours


def time_trial_vector(
    num_envs: int = 1, track: str = "covapsy-train-2023", **options: Any
) -> KartVectorEnv:
    """Return `num_envs` karts, each alone on its track.

    options: as for `time_trial_task` and `KartVectorEnv`.
    """
    of_task, own = split_options(options)
    return vector_of(time_trial_task(track, **of_task), num_envs, own)


def race_vector(
    num_envs: int = 1, track: str = "covapsy-train-2023", karts: int = 8, **options: Any
) -> KartVectorEnv:
    """Return races among scripted karts with `num_envs` learning karts in all.

    options: as for `mixed_task` and `KartVectorEnv`; with `learners=2` each race has two of them.
    """
    of_task, own = split_options(options)
    return vector_of(mixed_task(track, karts=karts, **of_task), num_envs, own)
