"""`Kart/ParkCompatible-v0`: a car park with the interface of highway-env's `parking-v0`.

Its car, slots and walls, five decisions a second for at most 100 s, its goals, its reward and its
rule of success.
"""

from collections.abc import Callable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from gymnasium import Space, spaces

from race_server.core.clock import TICKS_PER_SECOND
from race_server.core.kernels.jit import bind
from race_server.core.level import Level
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.compatible.cars import Array, Infos, Moved, begin_round, decisions_of
from race_server.envs.compatible.config import config_of
from race_server.envs.compatible.outcomes import (
    PARTS,
    SCALES,
    Outcomes,
    Prices,
    judge,
    write_nearness,
)
from race_server.envs.compatible.single import CompatibleEnv
from race_server.envs.compatible.vector import CompatibleVector
from race_server.envs.presets import parking_task
from race_server.envs.task import Task
from race_server.scenario.track.course import Course
from race_server.scenario.track.polyline import segments_of

NAME = "parking-v0"
FEATURES = ["x", "y", "vx", "vy", "cos_h", "sin_h"]  # of a goal
FIXED = ("observation", "action", "controlled_vehicles", "vehicles_count", "steering_range")
OPEN = 150.0  # [m] from the middle to where the ground ends, without walls; it stops a car there
# Ends are theirs alone: nothing is parked by our rules.
NEVER = Level(within=1e-9, hold_s=1e4)
_OUTCOMES = {"_judge", "_is_judged", "_moved", "_goals"}  # attributes that refer to own arrays


class ParkCars:
    """One car in each of many car parks that drives to its slot."""

    defaults: ClassVar[Mapping[str, Any]] = MappingProxyType(
        {
            "observation": {
                "type": "KinematicsGoal",
                "features": FEATURES,
                "scales": [100, 100, 5, 5, 1, 1],
                "normalize": False,
            },
            "action": {"type": "ContinuousAction"},
            "controlled_vehicles": 1,
            "vehicles_count": 0,
            "steering_range": np.deg2rad(45),
            # The reward is minus the root of the weighted differences of two goals.
            "reward_weights": [1, 0.3, 0, 0, 0.02, 0.02],
            "success_goal_reward": 0.12,
            "collision_reward": -5.0,
            "policy_frequency": 5,
            "duration": 100.0,
            "add_walls": True,
        }
    )

    def __init__(self, changes: Mapping[str, Any], worlds: int) -> None:
        """Build the car parks. changes: of the configuration.

        Raises:
            ScenarioError: the configuration is not valid.
        """
        self.config = config_of(NAME, self.defaults, changes, FIXED)
        self._weights = np.asarray(self.config["reward_weights"], np.float64)
        self.batch = Batch(self._task(), worlds=worlds, seed=None, after=STAY)
        self._steps = np.zeros(worlds, np.int64)
        self._make_outcomes()
        box = spaces.Box(-np.inf, np.inf, (len(SCALES),), np.float64)
        self.observation_space: Space[Any] = spaces.Dict(
            {"observation": box, "achieved_goal": box, "desired_goal": box}
        )
        self.action_space: Space[Any] = spaces.Box(-1.0, 1.0, (2,), np.float32)

    def _task(self) -> Task:
        task = parking_task(
            NAME,
            limit_s=self.config["duration"] + 1.0,  # time is up here, and not in the lot
            observation=PARTS,
            action="control",
            reward={"parked": 1.0},
            decision_ticks=TICKS_PER_SECOND // self.config["policy_frequency"],
        )
        (scenario,) = task.scenarios
        scenario = replace(scenario, level=NEVER)
        if not self.config["add_walls"]:
            rules = replace(scenario.rules, wall_contact="bump")
            scenario = replace(scenario, course=_open(scenario.course), rules=rules)
        return replace(task, scenarios=(scenario,))

    def _make_outcomes(self) -> None:
        """Make room for what the cars come to, and the call that writes it."""
        told = Outcomes.of(self.batch.worlds)
        self._judge, self._is_judged = self._bound_judge(told), False
        # Their arrays are written by each call of it.
        infos = {"speed": told.speeds, "crashed": told.crashed, "is_success": told.arrived}
        self._moved = Moved(told.rewards, told.over, told.cut, infos)
        self._goals = {
            "observation": told.achieved,
            "achieved_goal": told.achieved,
            "desired_goal": told.desired,
        }

    def __getstate__(self) -> dict[str, Any]:
        """Return what a copy begins with: all but what is judged of these cars."""
        return {name: value for name, value in vars(self).items() if name not in _OUTCOMES}

    def __setstate__(self, state: dict[str, Any]) -> None:
        """Begin as a copy."""
        vars(self).update(state)
        self._make_outcomes()

    def _bound_judge(self, outcomes: Outcomes) -> Callable[[], None]:
        """Return a call that writes what the cars have come to."""
        slices, config = self.batch.layout.slices, self.config
        places = np.array([slices[name].start for name in PARTS])
        prices = Prices(
            self._weights,
            float(config["collision_reward"]),
            float(config["success_goal_reward"]),
            decisions_of(config),
        )
        bodies, seen = self.batch.world.bodies, self.batch.observations
        return bind(judge, bodies, seen, places, self._steps, prices, outcomes)

    def begin(self, w: int, seed: int | None, chance: np.random.Generator) -> None:
        """Put one car into the middle, and draw its slot."""
        begin_round(self.batch, w, seed, chance)
        self._steps[w] = 0
        self._is_judged = False

    def observe(self) -> dict[str, Array]:
        """Return where the cars are, and where they are wanted: each (W, 6)."""
        self._judge_once()
        return self._goals

    def move(self, actions: Array) -> Moved:
        """Move on. actions: (W, 2) acceleration and steering, shares of 5 m/s² and 45°."""
        controls = self.batch.buffers.actions
        controls[:, 0, :2] = actions[:, ::-1]
        self.batch.step()
        self._steps += 1
        self._is_judged = False
        self._judge_once()
        return self._moved

    def infos(self, actions: Array) -> Infos:
        """Return speeds [m/s], crashes and successes."""
        self._judge_once()
        return self._moved.infos

    def _judge_once(self) -> None:
        """Write what the cars have come to, once for all that have begun or moved since."""
        if not self._is_judged:
            self._judge()
            self._is_judged = True

    def reward(self, achieved: Array, desired: Array) -> Array:
        """Return the reward for goals (n, 6) or (6,)."""
        both = np.broadcast_arrays(np.asarray(achieved, np.float64), desired)
        here, there = (np.array(goals, np.float64).reshape(-1, len(SCALES)) for goals in both)
        rewards = np.empty(len(here))
        write_nearness(here, there, self._weights, rewards)
        return rewards.reshape(both[0].shape[:-1])[()]


class ParkCompatible(CompatibleEnv):
    """One car that drives to its slot, by the names and numbers of `parking-v0`."""

    cars_of = ParkCars

    def compute_reward(self, achieved_goal: Array, desired_goal: Array, info: Any) -> Array:
        """Return the reward for goals (n, 6) or (6,). info: not used."""
        assert isinstance(self.cars, ParkCars)
        return self.cars.reward(achieved_goal, desired_goal)


class ParkCompatibleVector(CompatibleVector):
    """Many cars that drive to their slots, each in its own car park."""

    def compute_reward(self, achieved_goal: Array, desired_goal: Array, info: Any) -> Array:
        """Return the reward for goals (n, 6) or (6,). info: not used."""
        assert isinstance(self.cars, ParkCars)
        return self.cars.reward(achieved_goal, desired_goal)


def park_compatible_vector(
    num_envs: int = 1, config: Mapping[str, Any] | None = None, render_mode: str | None = None
) -> ParkCompatibleVector:
    """Return `num_envs` cars, each in its own car park. config: as of `ParkCompatible`."""
    return ParkCompatibleVector(ParkCars(config or {}, num_envs), render_mode)


def _open(course: Course) -> Course:
    """Return the car park without the walls around it: the ground ends far away."""
    corners = OPEN * np.array([(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)])
    return replace(
        course,
        borders=segments_of(corners),
        width_max=2.0 * OPEN,
        width_min=2.0 * OPEN,
        width_mean=2.0 * OPEN,
        digest=f"{course.digest}-open",
    )
