"""Gymnasium: one learning kart, alone (`Kart/TimeTrial-v0`) or in a race (`Kart/Race-v0`)."""

from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from race_server.envs.action_shapes import action_as
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.camera import RENDER_MODES, Camera
from race_server.envs.presets import mixed_task, time_trial_task
from race_server.envs.spaces import action_space, masks_for, observation_space
from race_server.envs.task import Task
from race_server.errors import ScenarioError


class OneKart(gymnasium.Env[Any, Any]):
    """One race in which one kart learns."""

    metadata = {
        "render_modes": list(RENDER_MODES),
        "render_fps": 20,  # of the default task
    }

    def __init__(self, task: Task, *, render_mode: str | None = None) -> None:
        """Build the race.

        Raises:
            ScenarioError, DriverError: the task makes no race, or more than one kart learns.
        """
        self.render_mode = render_mode
        self.batch = Batch(task, seed=None, after=STAY)
        if self.batch.learners != 1:
            raise ScenarioError(
                f"{self.batch.learners} karts learn in this task: choose one, or use "
                "race_server.envs.parallel"
            )
        self.metadata = {**self.metadata, "render_fps": task.decisions_per_s}
        self.observation_space = observation_space(self.batch.layout)
        self.action_space = action_space(task.action)
        self._camera = Camera(self.batch, render_mode)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a new race; with a seed the same one again. options: as for `Batch.reset`.

        Raises:
            ScenarioError: the task has not what the options ask for.
        """
        super().reset(seed=seed)
        seen = self.batch.reset(seed, options)
        self._camera.follow()
        return seen[0, 0].copy(), {"reality_gap": self.batch.draws(0, 0)}

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Move the race on by one decision.

        Raises:
            ScenarioError: the action has another shape, or is no number; the episode is over.
        """
        batch, buffers = self.batch, self.batch.buffers
        if buffers.idle[0, 0]:
            raise ScenarioError("the episode is over: call reset before the next step")
        buffers.actions[0, 0] = action_as(action, buffers.actions.shape[2])
        batch.step()
        self._camera.follow()
        is_over, is_cut = bool(buffers.terminated[0, 0]), bool(buffers.truncated[0, 0])
        info: dict[str, Any] = {
            "reward_terms": dict(zip(batch.terms, buffers.terms[0, 0].tolist(), strict=True))
        }
        if is_over or is_cut:
            outcome = batch.episode_of(0, 0)
            info[batch.task.discipline.outcome] = outcome
            if "is_success" in outcome:
                info["is_success"] = outcome["is_success"]
        return (
            buffers.observations[0, 0].copy(),
            float(buffers.rewards[0, 0]),
            is_over,
            is_cut,
            info,
        )

    def action_masks(self) -> NDArray[np.bool_]:
        """Return which discrete actions count, shape (15,), as sb3-contrib asks for it."""
        return masks_for(self.action_space, self.batch.buffers.idle.ravel())[0]

    def save_state(self) -> bytes:
        """Return the state of the race, see `Batch.save_state`."""
        return self.batch.save_state()

    def load_state(self, state: bytes) -> NDArray[np.float32]:
        """Put the race into a saved state; return what the kart sees there."""
        self.batch.load_state(state)
        return self.batch.observations[0, 0].copy()

    def render(self) -> Any:
        """Return the race as a picture (`rgb_array`), or show it in a window (`human`)."""
        return self._camera.shoot()

    def close(self) -> None:
        """Close the window."""
        self._camera.close()
        self.batch.close()


def time_trial(
    track: str = "covapsy-train-2023", render_mode: str | None = None, **options: Any
) -> OneKart:
    """Return one kart alone on a track; options as for `race_server.envs.batch.Task`."""
    return OneKart(time_trial_task(track, **options), render_mode=render_mode)


def race(
    track: str = "covapsy-train-2023",
    karts: int = 8,
    render_mode: str | None = None,
    **options: Any,
) -> OneKart:
    """Return one learning kart among scripted ones; options as for `Task`."""
    return OneKart(mixed_task(track, karts=karts, **options), render_mode=render_mode)
