"""Soft actor-critic with hindsight experience replay on `Kart/ParkGoal-v0`.

M. Andrychowicz et al., Hindsight Experience Replay, 2017 (arXiv 1707.01495): a way that missed its
slot would have been right for a slot where it led.
"""

from typing import Any

import gymnasium
import numpy as np
import torch
from gymnasium import spaces
from numpy.typing import NDArray
from stable_baselines3 import SAC, HerReplayBuffer
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import DummyVecEnv, VecEnv

from race_agents.training.settings import Settings
from race_server.core.observation import layout_of
from race_server.core.vehicle_presets import vehicle_named
from race_server.envs.parking.goal import METRES, OWN
from race_server.envs.registration import PARK_GOAL, register_gymnasium
from race_server.scenario.level import level_named

Array = NDArray[Any]

# A pedal pressed less than this lets the vehicle roll: otherwise it would stand still only by
# answers within 0.03 of zero, where rolling resistance holds it.
SLACK = 0.2
# What stays of what an environment tells.
KEPT = ("crashed", "is_success")
DRAWS = 8  # poses of one way that are tried as a goal, the first fit one is taken
CLEARANCE = 5.0  # [m] beyond which a range makes less difference
# What makes 1 to the network, of each part: [m/s], [rad/s], [rad].
SCALES = {"speed": 3.0, "lateral_speed": 1.0, "yaw_rate": 2.0, "steering": 0.5}


class Told(dict[str, Any]):
    """What a step told; nothing changes it, so that copies of a replay buffer are itself."""

    def __deepcopy__(self, _: Any) -> "Told":
        return self


class Vehicles(gymnasium.Wrapper[Any, Any, Any, Any]):
    """A vehicle with a slack pedal that is told little: what a replay buffer keeps."""

    def step(self, action: Any) -> tuple[Any, Any, bool, bool, dict[str, Any]]:
        """Move on by one decision."""
        seen, reward, is_over, is_cut, info = self.env.step(slackened(action))
        kept = {name: info[name] for name in KEPT if name in info}
        return seen, reward, is_over, is_cut, Told(kept)


def slackened(actions: Array) -> Array:
    """Return actions (..., 2) of pedal and steering, with a pedal that does nothing near zero."""
    changed = np.array(actions, np.float32)
    pedal = changed[..., 0]
    changed[..., 0] = np.sign(pedal) * np.maximum(np.abs(pedal) - SLACK, 0.0) / (1.0 - SLACK)
    return changed


class Hindsight(HerReplayBuffer):
    """Ways with goals where they led.

    A goal that is reached ends the way, as a slot does. Where a vehicle has to stand still, goals
    are poses in which it stood, if it did: a moving one parks nowhere.
    """

    def __init__(self, *args: Any, still: float = 0.0, **options: Any) -> None:
        """Prepare an empty buffer.

        still: share of the top speed below which a vehicle stands; 0: it need not.
        """
        super().__init__(*args, **options)
        self.still = still

    def _sample_goals(self, batch_indices: Array, env_indices: Array) -> Array:
        """Return goals (n, 5): where the same ways led later."""
        goals = super()._sample_goals(batch_indices, env_indices)
        if not self.still:
            return goals
        for _ in range(DRAWS - 1):
            moving = np.abs(goals[:, 4]) >= self.still
            if not moving.any():
                break
            goals[moving] = super()._sample_goals(batch_indices[moving], env_indices[moving])
        return goals

    def _get_virtual_samples(self, *args: Any, **options: Any) -> Any:
        """Return samples with goals in hindsight."""
        found = super()._get_virtual_samples(*args, **options)
        # The reward is 0 where a goal is reached, and -1 or less elsewhere.
        return found._replace(dones=torch.maximum(found.dones, (found.rewards >= 0.0).float()))


class SlotView(BaseFeaturesExtractor):
    """Shows a network the goal as seen from the vehicle, which is the same wherever a lot lies.

    Of goals it takes the pose, not the speed: that of a slot is always zero.
    """

    def __init__(self, space: spaces.Dict) -> None:
        """Take the space of `GoalView`."""
        self.slices = layout_of(OWN, 0).slices
        own = space["observation"].shape
        assert own is not None
        super().__init__(space, features_dim=own[0] + 10)

    def forward(self, seen: dict[str, torch.Tensor]) -> torch.Tensor:
        """Return what the network sees, (n, size)."""
        achieved, desired, own = seen["achieved_goal"], seen["desired_goal"], seen["observation"]
        dx, dy = (METRES * (desired - achieved)[:, :2]).unbind(1)
        cos, sin = achieved[:, 2:4].unbind(1)
        slot_cos, slot_sin = desired[:, 2:4].unbind(1)
        ahead, left = dx * cos + dy * sin, dy * cos - dx * sin
        turn_cos, turn_sin = slot_cos * cos + slot_sin * sin, slot_sin * cos - slot_cos * sin
        distance = torch.sqrt(ahead * ahead + left * left + 1e-6)
        goal = (
            *(ahead / METRES, left / METRES, distance / METRES),
            # Decimetres and degrees, once it is near.
            *(torch.tanh(ahead), torch.tanh(left), turn_cos, turn_sin, torch.tanh(5.0 * turn_sin)),
        )
        return torch.cat([torch.stack(goal, 1), 0.5 * achieved[:, :2], *self._own(own)], 1)

    def _own(self, own: torch.Tensor) -> list[torch.Tensor]:
        parts = []
        for name, place in self.slices.items():
            part = own[:, place]
            near = torch.exp(-part / CLEARANCE) if name.startswith("radar") else part
            parts.append(near / SCALES.get(name, 1.0))
        return parts


def vehicles_of(settings: Settings) -> VecEnv:
    """Return as many vehicles as the settings have worlds, each alone in the first of their lots.

    Raises:
        RaceError: the settings are not valid.
    """
    register_gymnasium()
    asked = settings.parking
    options: dict[str, Any] = {
        "lot": asked.lots[0],
        "vehicle": settings.vehicle,
        "level": asked.level,
        "limit_s": asked.limit_s,
        "decision_ticks": asked.decision_ticks,
    }

    def vehicle() -> gymnasium.Env[Any, Any]:
        one = gymnasium.make(PARK_GOAL, disable_env_checker=True, **options)
        return Monitor(Vehicles(one), info_keywords=("is_success",))

    return DummyVecEnv([vehicle] * settings.worlds)


def hindsight_learner(settings: Settings, vehicles: VecEnv) -> SAC:
    """Return an untrained learner for vehicles of `vehicles_of`.

    `algorithm.options` are those of SAC.
    """
    torch.set_num_threads(1)
    still = level_named(settings.parking.level).still / vehicle_named(settings.vehicle).top_speed
    return SAC(
        "MultiInputPolicy",
        vehicles,
        learning_rate=_rate(settings),
        replay_buffer_class=Hindsight,
        replay_buffer_kwargs={"n_sampled_goal": 4, "copy_info_dict": True, "still": still},
        policy_kwargs={
            "net_arch": list(settings.network.layers),
            "features_extractor_class": SlotView,
            "optimizer_kwargs": {"fused": True},  # one call for all parameters
        },
        seed=settings.seed,
        device="cpu",
        **settings.algorithm.options,
    )


def _rate(settings: Settings) -> Any:
    """Return the learning rate by the share of decisions that is left."""
    first, last = settings.algorithm.learning_rate, settings.algorithm.last_learning_rate
    return first if last is None else lambda left: last + left * (first - last)
