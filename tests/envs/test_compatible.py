"""Environments of ours with the interfaces of highway-env's."""

import math
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

import race_server.envs  # noqa: F401  # registers the ids
from race_server.scenario.highway import has_highway, make_highway

needs_highway = pytest.mark.skipif(not has_highway(), reason="highway-env is not installed")
PAIRS = {"Kart/ParkCompatible-v0": "parking-v0", "Kart/RacetrackCompatible-v0": "racetrack-v0"}


@needs_highway
@pytest.mark.parametrize("name", PAIRS)
def test_spaces_and_infos_are_those_of_highway_env(name: str) -> None:
    ours, theirs = gymnasium.make(name, disable_env_checker=True), make_highway(PAIRS[name])
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert ours.reset(seed=1)[1].keys() == theirs.reset(seed=1)[1].keys()
    action = ours.action_space.sample()
    assert ours.step(action)[4].keys() == theirs.step(action)[4].keys()


@needs_highway
@pytest.mark.filterwarnings("ignore:.*A Box observation space")
@pytest.mark.parametrize("name", PAIRS)
def test_gymnasium_finds_no_fault(name: str) -> None:
    check_env(gymnasium.make(name, disable_env_checker=True).unwrapped, skip_render_check=True)


def park(x: float, y: float, degrees: float, speed: float = 0.0) -> Any:
    """Return the car park with its car at a place; its slot is drawn by seed 1."""
    env: Any = gymnasium.make("Kart/ParkCompatible-v0", disable_env_checker=True).unwrapped
    env.reset(seed=1)
    body = env._car.batch.world.bodies[0, 0]
    body.x, body.y, body.heading, body.speed = x, y, math.radians(degrees), speed
    return env


def test_the_car_speeds_up_as_its_action_says() -> None:
    env = park(0.0, 0.0, 0.0)
    seen, *_ = env.step([1.0, 0.0])
    # 5 m/s² for 0.2 s; goals hold speeds in 5 m/s.
    assert seen["achieved_goal"][2] == pytest.approx(1.0 / 5.0, rel=1e-3)


def test_the_reward_is_the_root_of_weighted_differences() -> None:
    env = park(0.0, 0.0, 0.0)
    near = np.array([0.10, 0.20, 0.3, 0.4, 1.0, 0.0])
    far = near + np.array([0.01, -0.02, 9.0, 9.0, 0.0, 0.0])
    # 0.01 in x, and 0.3 of 0.02 in y.
    assert env.compute_reward(near, far, {}) == pytest.approx(-math.sqrt(0.016))
    rows = env.compute_reward(np.stack([near, near]), np.stack([near, far]), [{}, {}])
    assert rows.tolist() == pytest.approx([0.0, -math.sqrt(0.016)])


def test_a_car_in_its_slot_has_made_it_and_one_at_the_wall_has_crashed() -> None:
    env = park(0.0, 0.0, 0.0)
    x, y, _, _, cos, sin = env.reset(seed=1)[0]["desired_goal"]
    env = park(100.0 * x, 100.0 * y, math.degrees(math.atan2(sin, cos)))
    *_, is_over, _, info = env.step([0.0, 0.0])
    assert (is_over, info["is_success"], info["crashed"]) == (True, True, False)
    env = park(30.0, 0.0, 0.0, speed=20.0)
    _, reward, is_over, _, info = env.step([0.0, 0.0])
    assert (is_over, info["is_success"], info["crashed"]) == (True, False, True)
    assert reward < -5.0


def test_time_is_up_after_100_seconds() -> None:
    env = park(0.0, 0.0, 0.0)
    cuts = [env.step([0.0, 0.0])[3] for _ in range(500)]
    assert cuts == [False] * 499 + [True]


@needs_highway
def test_a_car_that_is_not_steered_leaves_the_road_at_the_first_bend() -> None:
    env = gymnasium.make("Kart/RacetrackCompatible-v0", disable_env_checker=True)
    env.reset(seed=2)
    for _ in range(100):
        seen, reward, is_over, _, info = env.step([0.0])
        if is_over:
            break
    assert not info["rewards"]["on_road_reward"]
    assert reward == 0.0
    assert info["speed"] == pytest.approx(10.0, abs=0.5)  # slower off the road
    assert seen[0, 6, 6] == 1.0  # its own cell
