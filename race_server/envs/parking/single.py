"""Gymnasium: one vehicle that parks, with or without a trailer, and with goals apart."""

from typing import Any

import gymnasium
from numpy.typing import NDArray

from race_server.envs.parking.goal import PARTS, TRAILER_PARTS, GoalView
from race_server.envs.presets import parking_task
from race_server.envs.single import OneKart
from race_server.envs.task import Task
from race_server.envs.vector import KartVectorEnv, split_options, vector_of
from race_server.errors import ScenarioError

Goals = dict[str, NDArray[Any]]
# Terms of the ends that cost as a crash does: an early end must not be better than to drive on.
CRASHES = ("crash", "jack_knife", "left")


class ParkGoal(gymnasium.Env[Any, NDArray[Any]]):
    """One vehicle that drives to its slot; observations are dictionaries with goals."""

    metadata = OneKart.metadata

    def __init__(self, kart: OneKart, reward: str) -> None:
        """Take the only vehicle of a task.

        reward: sparse (0 within the tolerances, otherwise -1) or dense.

        Raises:
            ScenarioError: there is no such reward.
        """
        self.kart = kart
        self.metadata = kart.metadata
        self.render_mode = kart.render_mode
        self.view = GoalView.of(kart.batch.task, kart.batch.layout, reward)
        self.observation_space: gymnasium.Space[Any] = self.view.space
        self.action_space = kart.action_space

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[Goals, dict[str, Any]]:
        """Begin a new way; with a seed the same one again. options: as for `Batch.reset`."""
        super().reset(seed=seed)
        seen, info = self.kart.reset(seed=seed, options=options)
        return self.view.split(seen), info

    def step(self, action: Any) -> tuple[Goals, float, bool, bool, dict[str, Any]]:
        """Move the vehicle on by one decision."""
        seen, _, is_over, is_cut, info = self.kart.step(action)
        info["crashed"] = any(info["reward_terms"][name] for name in CRASHES)
        split = self.view.split(seen)
        reward = self.compute_reward(split["achieved_goal"], split["desired_goal"], info)
        return split, float(reward), is_over, is_cut, info

    def compute_reward(
        self, achieved_goal: NDArray[Any], desired_goal: NDArray[Any], info: Any
    ) -> NDArray[Any]:
        """Return the reward for goals (n, g) or (g,); see `GoalView.rewards`."""
        return self.view.rewards(achieved_goal, desired_goal, info)

    def save_state(self) -> bytes:
        """Return the state of the lot, see `Batch.save_state`."""
        return self.kart.save_state()

    def load_state(self, state: bytes) -> Goals:
        """Put the lot into a saved state; return what the vehicle sees there."""
        return self.view.split(self.kart.load_state(state))

    def render(self) -> Any:
        """Return the lot as a picture (`rgb_array`), or show it in a window (`human`)."""
        return self.kart.render()

    def close(self) -> None:
        """Close the window."""
        self.kart.close()


def park(lot: str = "yard-70", render_mode: str | None = None, **options: Any) -> OneKart:
    """Return one vehicle that drives to its slot; options as for `parking_task`."""
    return OneKart(parking_task(lot, **options), render_mode=render_mode)


def park_vector(num_envs: int = 1, lot: str = "yard-70", **options: Any) -> KartVectorEnv:
    """Return `num_envs` vehicles, each alone in its lot."""
    of_task, own = split_options(options)
    return vector_of(parking_task(lot, **of_task), num_envs, own)


def park_goal(
    lot: str = "zone-30",
    render_mode: str | None = None,
    reward: str = "sparse",
    level: str = "goal",
    **options: Any,
) -> ParkGoal:
    """Return one vehicle with goals apart from observations; options as for `parking_task`."""
    task = _with_goals(lot, PARTS, level=level, **options)
    return ParkGoal(OneKart(task, render_mode=render_mode), reward)


def park_trailer(lot: str = "dock-35", render_mode: str | None = None, **options: Any) -> OneKart:
    """Return one vehicle with a trailer that drives to its slot; options as for `parking_task`."""
    return OneKart(_with_trailer(lot, **options), render_mode=render_mode)


def park_trailer_vector(num_envs: int = 1, lot: str = "dock-35", **options: Any) -> KartVectorEnv:
    """Return `num_envs` vehicles with a trailer, each alone in its lot."""
    of_task, own = split_options(options)
    return vector_of(_with_trailer(lot, **of_task), num_envs, own)


def park_trailer_goal(
    lot: str = "dock-35",
    render_mode: str | None = None,
    reward: str = "sparse",
    level: str = "goal-trailer",
    **options: Any,
) -> ParkGoal:
    """Return one vehicle with a trailer, with goals apart; options as for `parking_task`."""
    task = _with_goals(lot, TRAILER_PARTS, level=level, **options)
    return ParkGoal(OneKart(task, render_mode=render_mode), reward)


def _with_goals(lot: str, parts: tuple[str, ...], **options: Any) -> Task:
    """Return the task of parking seen by the parts that goals are made of."""
    if "observation" in options:
        raise ScenarioError(
            f"observation = {options['observation']!r}: an environment with goals has its own; "
            "leave it out, or take Kart/Park-v0"
        )
    return parking_task(lot, observation=parts, **options)


def _with_trailer(lot: str, **options: Any) -> Task:
    """Return the task of parking with a trailer, seen by its feelers unless told otherwise."""
    return parking_task(lot, **{"observation": "park_trailer", **options})
