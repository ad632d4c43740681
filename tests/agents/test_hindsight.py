"""Learning to park in hindsight: what the network sees, what a goal that was reached means."""

import copy
from typing import Any

import gymnasium
import numpy as np
import pytest
import torch
from gymnasium import spaces
from stable_baselines3.common.vec_env import DummyVecEnv

from race_agents.training.hindsight import Hindsight, SlotView, hindsight_learner, slackened
from race_agents.training.hindsight import vehicles_of as vehicles
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from race_server.core.observation import layout_of
from race_server.envs.parking.goal import CRASH, PARTS, GoalView
from race_server.scenario.level import level_named

TOP_SPEED = 4.0
GOALS = GoalView(layout_of(PARTS, 0), level_named("goal"), TOP_SPEED)
OWN = int(GOALS.space["observation"].shape[0])  # type: ignore[index]  # a box has a shape


def goal(x: float, y: float, degrees: float = 0.0, speed: float = 0.0) -> list[float]:
    """Return a pose in metres as a goal."""
    turn = np.radians(degrees)
    return [x / 10.0, y / 10.0, float(np.cos(turn)), float(np.sin(turn)), speed / TOP_SPEED]


def seen(achieved: list[float], desired: list[float]) -> dict[str, torch.Tensor]:
    one = {"achieved_goal": achieved, "desired_goal": desired, "observation": [0.0] * OWN}
    return {name: torch.tensor([row]) for name, row in one.items()}


class Rail(gymnasium.Env[Any, Any]):
    """A vehicle that moves on by two metres a decision, 3 times, towards a slot 9 m away."""

    observation_space = GOALS.space
    action_space = spaces.Box(-1.0, 1.0, (2,))

    def __init__(self, speed: tuple[float, ...] = (1.0, 1.0, 1.0)) -> None:
        self.speed = (0.0, *speed)

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[Any, dict[str, Any]]:
        self.steps = 0
        return self._seen(), {}

    def step(self, _: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.steps += 1
        return self._seen(), -1.0, False, self.steps == 3, {"crashed": False}

    def compute_reward(self, achieved: Any, desired: Any, infos: Any) -> Any:
        return GOALS.rewards(achieved, desired, infos)

    def _seen(self) -> dict[str, Any]:
        where = goal(2.0 * self.steps, 0.0, speed=self.speed[self.steps])
        rows = {"achieved_goal": where, "desired_goal": goal(9, 0), "observation": [0.0] * OWN}
        return {name: np.array(row, np.float32) for name, row in rows.items()}


def buffer_of(rail: Rail, **options: Any) -> Hindsight:
    """Return a buffer with one way on the rail."""
    env = DummyVecEnv([lambda: rail])
    held = Hindsight(
        10, env.observation_space, env.action_space, env=env, copy_info_dict=True, **options
    )
    before: Any = env.reset()
    for _ in range(3):
        after, rewards, dones, infos = env.step(np.zeros((1, 2)))
        last = infos[0].get("terminal_observation")
        now = {name: row[None] for name, row in last.items()} if last is not None else after
        held.add(before, now, np.zeros((1, 2)), rewards, dones, infos)
        before = after
    return held


def test_a_pedal_does_nothing_near_zero_and_all_at_its_end() -> None:
    pedals = slackened(np.array([[0.2, 0.5], [0.6, -1.0], [-1.0, 0.0]]))
    assert pedals.tolist() == pytest.approx(np.array([[0.0, 0.5], [0.5, -1.0], [-1.0, 0.0]]))


def test_a_network_sees_the_slot_from_the_vehicle() -> None:
    # It stands at (5, 5) and looks to the north; the slot is 3 m ahead and lies across.
    view = SlotView(GOALS.space)
    numbers = view(seen(goal(5, 5, 90), goal(5, 8, 0)))[0].tolist()
    ahead, left, distance, near_ahead, near_left, cos, sin = numbers[:7]
    assert (ahead, left, distance) == pytest.approx((0.3, 0.0, 0.3), abs=1e-5)
    assert (near_ahead, near_left) == pytest.approx((np.tanh(3.0), 0.0), abs=1e-5)
    assert (cos, sin) == pytest.approx((0.0, -1.0), abs=1e-5)
    assert len(numbers) == view.features_dim


def test_where_the_lot_lies_changes_nothing_but_the_place_in_it() -> None:
    view = SlotView(GOALS.space)
    here = view(seen(goal(1, 2, 30), goal(4, 6, 80)))[0]
    # Turned by 90 degrees and moved by (7, -3).
    there = view(seen(goal(5, -2, 120), goal(1, 1, 170)))[0]
    assert torch.allclose(here[:8], there[:8], atol=1e-5)
    assert not torch.allclose(here[8:10], there[8:10])


def test_a_way_would_have_been_right_for_where_it_led_and_ends_there() -> None:
    found = buffer_of(Rail()).sample(200)
    goals, there = (found.next_observations[name] for name in ("desired_goal", "achieved_goal"))
    reached = (goals - there).abs().sum(1) < 1e-6
    assert 0 < reached.sum() < 200
    assert (found.dones[reached] == 1.0).all()
    assert (found.rewards[reached] == 0.0).all()
    # 9 m is not one of the places where it led; the way was cut off, which is no end.
    given = goals[:, 0] == 0.9
    assert given.sum() == 40
    assert (found.dones[~reached] == 0.0).all()
    assert (found.rewards[~reached] == -1.0).all()


def test_goals_are_poses_in_which_the_vehicle_stood() -> None:
    held = buffer_of(Rail(speed=(1.0, 0.0, 1.0)), still=0.05)
    first = np.zeros(300, np.int64)
    goals = held._sample_goals(first, first)
    # Of three places one is drawn up to eight times: all but (2 / 3) ** 8 = 4 % take the second.
    assert (goals[:, 0] == np.float32(0.4)).mean() > 0.9


def test_no_crash_is_better_than_a_slot_that_is_never_reached() -> None:
    never = sum(-(0.95**step) for step in range(1000))
    assert never > CRASH - 1.0


def simple(*changes: str) -> Settings:
    """Return settings of SAC with a slot 5 m ahead."""
    return read_settings(
        "parking-1",
        (
            "parking.lots=['face-to-face']",
            "parking.level=goal",
            "parking.decision_ticks=12",
            "parking.limit_s=10.0",
            "algorithm={name = 'sac', learning_rate = 1e-3}",
            "worlds=4",
            *changes,
        ),
    )


def test_its_learning_rate_falls_evenly_to_the_last_one() -> None:
    karts = vehicles(simple("worlds=1"))
    asked = simple("worlds=1", "algorithm.last_learning_rate=1e-4")
    rate = hindsight_learner(asked, karts).lr_schedule
    assert [rate(left) for left in (1.0, 0.5, 0.0)] == pytest.approx([1e-3, 5.5e-4, 1e-4])
    assert hindsight_learner(simple("worlds=1"), karts).lr_schedule(0.0) == 1e-3
    karts.close()


def test_lessons_do_not_copy_what_steps_told() -> None:
    karts = vehicles(simple("worlds=1"))
    karts.reset()
    _, _, _, (told,) = karts.step(np.zeros((1, 2), np.float32))
    assert copy.deepcopy(told) is told
    assert told["crashed"] is False
    karts.close()


@pytest.mark.slow
def test_hindsight_learns_to_park_ahead_in_two_thousand_decisions() -> None:
    settings = simple(
        "steps=2000",
        "network.layers=[64, 64]",
        "algorithm.options={buffer_size = 4000, learning_starts = 400, gradient_steps = 4, "
        "gamma = 0.95, tau = 0.05, ent_coef = 'auto_0.1'}",
    )
    karts = vehicles(settings)
    learner = hindsight_learner(settings, karts)
    learner.learn(2000)
    karts.close()
    assert learner.ep_success_buffer is not None
    assert np.mean(list(learner.ep_success_buffer)[-10:]) >= 0.8
