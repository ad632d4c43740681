"""`parking-v0` for a policy of ours: it sees what a kart sees, and drives by pedal and wheel."""

import math
from collections.abc import Mapping
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from race_agents.reproductions.parking_v0 import (
    ACCELERATION,
    DECISION_S,
    LIMIT_S,
    STEERING_LIMIT,
    WHEELBASE,
    make_parking_v0,
)
from race_agents.training.settings import Settings
from race_server.core.observation import layout_of
from race_server.core.rules.parking import ALIGNED_WITHIN
from race_server.core.vehicle_presets import vehicle_named
from race_server.core.vehicles import Vehicle
from race_server.envs.actions import REVERSE_BELOW
from race_server.envs.parking.reward_terms import REWARDS
from race_server.envs.spaces import action_space, observation_space
from race_server.errors import ScenarioError
from race_server.second.similarity import Similarity


def similar_kart(settings: Settings) -> Similarity:
    """Return the similarity with the kart's turning circle at full lock and its pace."""
    there = WHEELBASE / math.tan(STEERING_LIMIT)
    radius = vehicle_named(settings.vehicle).turning_radius
    return Similarity(there / radius, DECISION_S / settings.decision_s)


class KartThere(gymnasium.Env[Any, Any]):
    """`parking-v0` as settings of ours see and drive it; rewards are theirs, too.

    It ends with its own success, which counts as parked, a crash, or after a minute.
    """

    def __init__(self, settings: Settings, similar: Similarity) -> None:
        """Build the environment.

        Raises:
            ScenarioError: highway-env is not installed, or has no such thing to see or to reward.
        """
        self.env = make_parking_v0()
        self.kart: Vehicle = vehicle_named(settings.vehicle)
        self.similar = similar
        layout = layout_of(settings.observation, settings.lidar.rays)
        self.parts = tuple(layout.slices)
        self.observation_space = observation_space(layout)
        self.action_space = action_space(settings.action)
        named = settings.reward
        self.weights: Mapping[str, float] = REWARDS[named] if isinstance(named, str) else named
        if settings.action != "park":
            raise ScenarioError(f"action {settings.action!r}: `parking-v0` takes park")
        self.begin()
        self.env.reset(seed=0)
        self._before = self.values()
        _check("observes", self.parts, self._before)
        _check("rewards", self.weights, self._terms({"is_success": False, "crashed": False}, False))

    def begin(self) -> None:
        """Put the wheels straight."""
        self.steering = 0.0

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float32], dict[str, Any]]:
        """Begin a new way. Options are not used."""
        self.begin()
        self.env.reset(seed=seed)
        self._before = self.values()
        return self.seen(), {}

    def step(self, action: Any) -> tuple[NDArray[np.float32], float, bool, bool, dict[str, Any]]:
        """Move on by one decision."""
        _, _, is_over, is_cut, info = self.env.step(self.controls(action))
        terms = self._terms(info, is_cut)
        reward = sum(weight * terms[name] for name, weight in self.weights.items())
        self._before = self.values()
        return self.seen(), reward, is_over, is_cut, {"is_success": info["is_success"]}

    def controls(self, action: Any) -> NDArray[np.float32]:
        """Return pedal and steering there, (2,), of a kart's, whose wheels turn at its rate."""
        pedal, wanted = np.clip(np.asarray(action, np.float64), -1.0, 1.0)
        kart, similar = self.kart, self.similar
        dt = DECISION_S / similar.time
        turn = kart.steering_rate * dt
        target = wanted * kart.steering_limit
        self.steering += min(max(target - self.steering, -turn), turn)
        # At any lock it turns as narrowly, beside its length.
        share = math.tan(self.steering) / math.tan(kart.steering_limit)
        angle = math.atan(share * math.tan(STEERING_LIMIT))
        speed = self._car.speed * similar.time / similar.length
        if pedal < 0.0 and speed > REVERSE_BELOW:
            gained = max(pedal * kart.brake_force / kart.mass, -speed / dt)
        else:
            gained = pedal * kart.motor_force / kart.mass
            low, high = -kart.reverse_speed - speed, kart.top_speed - speed
            gained = min(max(gained, low / dt), high / dt)
        pushed = gained * similar.length / similar.time**2 / ACCELERATION
        return np.array([min(max(pushed, -1.0), 1.0), angle / STEERING_LIMIT], np.float32)

    @property
    def _car(self) -> Any:
        return self.env.unwrapped.vehicle

    def seen(self) -> NDArray[np.float32]:
        """Return what the policy sees, (size,)."""
        values = self.values()
        return np.array([values[name] for name in self.parts], np.float32)

    def values(self) -> dict[str, float]:
        """Return all that a kart would see, by the name of the part."""
        car, similar = self._car, self.similar
        pace = similar.time / similar.length
        x, y = (float(at) / similar.length for at in car.position)
        slot_x, slot_y = (float(at) / similar.length for at in car.goal.position)
        heading = math.remainder(float(car.heading), math.tau)
        slot_heading = math.remainder(float(car.goal.heading), math.tau)
        cos, sin, dx, dy = math.cos(heading), math.sin(heading), slot_x - x, slot_y - y
        ahead, left = dx * cos + dy * sin, dy * cos - dx * sin
        # The middle of the car moves at this angle to it, half way between its axles.
        slip = math.atan(0.5 * math.tan(float(car.action["steering"])))
        along, across = math.cos(slip) * car.speed * pace, math.sin(slip) * car.speed * pace
        return {
            "speed": along,
            "lateral_speed": across,
            "yaw_rate": math.sin(slip) * car.speed / (0.5 * WHEELBASE) * similar.time,
            "steering": self.steering,
            "position_x": x,
            "position_y": y,
            "heading": heading,
            "heading_cos": cos,
            "heading_sin": sin,
            "velocity_x": along * cos - across * sin,
            "velocity_y": along * sin + across * cos,
            "slot_x": slot_x,
            "slot_y": slot_y,
            "slot_heading": slot_heading,
            "to_slot_x": dx,
            "to_slot_y": dy,
            "goal_x": ahead,
            "goal_y": left,
            "goal_cos": math.cos(slot_heading - heading),
            "goal_sin": math.sin(slot_heading - heading),
            "goal_distance": math.hypot(dx, dy),
            "goal_proximity": 1.0 / (1.0 + math.hypot(dx, dy)),
            "goal_bearing": math.atan2(left, ahead),
        }

    def _terms(self, info: Mapping[str, Any], is_cut: bool) -> dict[str, float]:
        """Return what a decision is worth, by the names of our rewards' terms."""
        now = self.values()
        before = self._before
        turns = [abs(math.atan2(one["goal_sin"], one["goal_cos"])) for one in (before, now)]
        distance, is_parked = now["goal_distance"], bool(info["is_success"])
        is_aligned = turns[1] <= ALIGNED_WITHIN
        return {
            "parked": float(is_parked),
            "aligned": float(is_parked and is_aligned),
            "misparked": float(is_parked and not is_aligned),
            "crash": float(info["crashed"]),
            "left": 0.0,  # walls are around the lot
            "late": float(is_cut),
            "time": DECISION_S / LIMIT_S,
            "goal_progress": before["goal_distance"] - distance,
            "goal_turn": (turns[0] - turns[1]) / (1.0 + distance),
        }


def _check(verb: str, wanted: Any, known: Mapping[str, float]) -> None:
    if unknown := [name for name in wanted if name not in known]:
        raise ScenarioError(
            f"a policy that {verb} {', '.join(unknown)}: `parking-v0` has only {', '.join(known)}"
        )
