"""`Kart/ParkCompatible-v0`: a car park with the interface of highway-env's `parking-v0`.

Its car, slots and walls, five decisions a second for at most 100 s, its goals, its reward and its
rule of success.
"""

from typing import Any

import gymnasium
import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from race_server.core.clock import TICKS_PER_SECOND
from race_server.envs.presets import parking_task
from race_server.envs.single import OneKart

Array = NDArray[Any]

DECISION_TICKS = TICKS_PER_SECOND // 5
LIMIT_S = 100.0
# A goal is x, y [m], speeds [m/s], cosine and sine of the heading, each divided by its scale.
SCALES = np.array([100.0, 100.0, 5.0, 5.0, 1.0, 1.0])
# The reward is minus the root of the weighted differences of two goals, and -5 for a crash.
WEIGHTS = np.array([1.0, 0.3, 0.0, 0.0, 0.02, 0.02])
CRASH = -5.0
SUCCESS = -0.12  # a reward above it, a crash aside
PARTS = (
    *("position_x", "position_y", "heading_cos", "heading_sin", "speed"),
    *("slot_x", "slot_y", "slot_heading"),
)


class ParkCompatible(gymnasium.Env[Any, Array]):
    """One car that drives to its slot, by the names and numbers of `parking-v0`."""

    metadata = OneKart.metadata

    def __init__(self, render_mode: str | None = None) -> None:
        """Build the car park."""
        self.render_mode = render_mode
        task = parking_task(
            "parking-v0",
            limit_s=LIMIT_S + 1.0,  # time is up here, and not in the lot
            observation=PARTS,
            action="control",
            reward={"parked": 1.0},
            decision_ticks=DECISION_TICKS,
        )
        self._car = OneKart(task, render_mode=render_mode)
        slices = self._car.batch.layout.slices
        self._places = np.array([slices[name].start for name in PARTS])
        self._steps = 0
        box = spaces.Box(-np.inf, np.inf, (6,), np.float64)
        self.observation_space = spaces.Dict(
            {"observation": box, "achieved_goal": box, "desired_goal": box}
        )
        self.action_space = spaces.Box(-1.0, 1.0, (2,), np.float32)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, Array], dict[str, Any]]:
        """Begin a new way; with a seed the same one again. Options are not used."""
        super().reset(seed=seed)
        seen, _ = self._car.reset(seed=seed)
        self._steps = 0
        goals = self._goals(seen)
        action = self.action_space.sample()
        return goals, self._info(self._near(goals), seen, action, crashed=False)

    def step(self, action: Any) -> tuple[dict[str, Array], float, bool, bool, dict[str, Any]]:
        """Move on by 0.2 s. action: (2,) acceleration and steering, shares of 5 m/s² and 45°."""
        push, steering = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        seen, _, _, _, told = self._car.step(np.array([steering, push, 0.0, 0.0], np.float32))
        self._steps += 1
        goals = self._goals(seen)
        crashed = bool(told["reward_terms"]["crash"])
        reward = self._near(goals)
        info = self._info(reward, seen, action, crashed=crashed)
        is_cut = self._steps * DECISION_TICKS >= LIMIT_S * TICKS_PER_SECOND
        is_over = crashed or info["is_success"]
        return goals, reward + CRASH * crashed, is_over, is_cut, info

    def compute_reward(self, achieved_goal: Array, desired_goal: Array, info: Any) -> Array:
        """Return the reward for goals (n, 6) or (6,). info: not used."""
        return -np.sqrt(np.abs(np.asarray(achieved_goal) - desired_goal) @ WEIGHTS)

    def _goals(self, seen: Array) -> dict[str, Array]:
        x, y, cos, sin, speed, slot_x, slot_y, slot_heading = seen[self._places].astype(np.float64)
        achieved = np.array([x, y, speed * cos, speed * sin, cos, sin]) / SCALES
        turned = np.cos(slot_heading), np.sin(slot_heading)
        desired = np.array([slot_x, slot_y, 0.0, 0.0, *turned]) / SCALES
        return {
            "observation": achieved,
            "achieved_goal": achieved.copy(),
            "desired_goal": desired,
        }

    def _info(self, reward: float, seen: Array, action: Any, *, crashed: bool) -> dict[str, Any]:
        return {
            "speed": float(seen[self._places[PARTS.index("speed")]]),
            "crashed": crashed,
            "action": action,
            "is_success": reward > SUCCESS,
        }

    def _near(self, goals: dict[str, Array]) -> float:
        return float(self.compute_reward(goals["achieved_goal"], goals["desired_goal"], {}))

    def render(self) -> Any:
        """Return the lot as a picture (`rgb_array`), or show it in a window (`human`)."""
        return self._car.render()

    def close(self) -> None:
        """Close the window."""
        self._car.close()
