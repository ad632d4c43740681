"""Environments of ours with the interfaces of highway-env's."""

import math
from typing import Any

import gymnasium
import numpy as np
import pytest

import race_server.envs  # noqa: F401  # registers the ids
from race_server.errors import ScenarioError
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
@pytest.mark.parametrize("name", PAIRS)
def test_a_configuration_has_what_that_of_highway_env_has(name: str) -> None:
    ours, theirs = gymnasium.make(name, disable_env_checker=True), make_highway(PAIRS[name])
    ours_config, their_config = ours.unwrapped.config, theirs.unwrapped.config  # type: ignore[attr-defined]
    task = ("policy_frequency", "duration", "collision_reward", "observation", "action")
    assert {key: ours_config[key] for key in task} == {key: their_config[key] for key in task}


def park(x: float, y: float, degrees: float, speed: float = 0.0, **config: Any) -> Any:
    """Return the car park with its car at a place; its slot is drawn by seed 1."""
    name = "Kart/ParkCompatible-v0"
    env: Any = gymnasium.make(name, disable_env_checker=True, config=config).unwrapped
    env.reset(seed=1)
    body = env.cars.batch.world.bodies[0, 0]
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


def test_a_duration_of_2_seconds_at_ten_decisions_a_second_is_20_decisions() -> None:
    env = park(0.0, 0.0, 0.0, duration=2, policy_frequency=10.0)
    assert [env.step([0.0, 0.0])[3] for _ in range(20)] == [False] * 19 + [True]


def test_what_is_only_for_pictures_may_be_anything() -> None:
    assert park(0.0, 0.0, 0.0, screen_width=None).config["screen_width"] is None


def test_without_walls_a_car_drives_on_where_they_would_stand() -> None:
    env = park(30.0, 0.0, 0.0, speed=20.0, add_walls=False)
    for _ in range(5):
        *_, is_over, _, info = env.step([0.0, 0.0])
    assert (is_over, info["crashed"]) == (False, False)
    assert env.cars.batch.world.bodies[0, 0].x == pytest.approx(50.0, abs=0.5)


def test_a_configuration_can_change_with_a_reset() -> None:
    env = park(0.0, 0.0, 0.0)
    env.reset(seed=1, options={"config": {"collision_reward": -7}})
    assert (env.config["collision_reward"], env.config["duration"]) == (-7, 100.0)


def goals_of(name: str, **options: Any) -> list[Any]:
    made = gymnasium.make_vec(name, num_envs=6, **options)
    return made.reset()[0]["desired_goal"].tolist()


@pytest.mark.parametrize("mode", ["sync", "vector_entry_point"])
def test_cars_that_got_no_seed_have_slots_of_their_own(mode: str) -> None:
    # Of 28 slots: six cars draw the same one once in 17 million times.
    first, second = (goals_of("Kart/ParkCompatible-v0", vectorization_mode=mode) for _ in range(2))
    assert first != second
    assert any(goal != first[0] for goal in first)


def test_cars_with_a_new_configuration_draw_slots_that_follow_from_the_last_seed() -> None:
    def goals() -> list[list[float]]:
        env = park(0.0, 0.0, 0.0)
        env.reset(seed=3)
        changes = [{"config": {"duration": 50 + number}} for number in range(6)]
        return [env.reset(options=each)[0]["desired_goal"].tolist() for each in changes]

    assert goals() == goals()
    assert any(goal != goals()[0] for goal in goals())


@needs_highway
def test_a_road_takes_seeds_of_every_size() -> None:
    env = gymnasium.make("Kart/RacetrackCompatible-v0", disable_env_checker=True)
    for seed in (2**63 - 1, 2**63, 2**100):
        first, again = env.reset(seed=seed)[0], env.reset(seed=seed)[0]
        assert np.array_equal(first, again)


def test_an_option_of_a_reset_that_there_is_not_is_named() -> None:
    with pytest.raises(ScenarioError, match="reset option 'gap' is unknown; choose of config"):
        park(0.0, 0.0, 0.0).reset(options={"gap": {"mass": 1.2}})
    with pytest.raises(ScenarioError, match="reset option 'config' is unknown; choose of none"):
        gymnasium.make_vec("Kart/ParkCompatible-v0", num_envs=2).reset(
            options={"config": {"duration": 9}}
        )


@pytest.mark.parametrize(
    ("config", "message"),
    [
        ({"walls": False}, "config 'walls' is unknown; choose from add_walls"),
        ({"vehicles_count": 3}, "config 'vehicles_count' is 3; here it stays 0"),
        ({"duration": 0}, "config 'duration' is 0; give seconds above 0"),
        ({"duration": 3600}, "config 'duration' is 3600; give seconds above 0, up to 3599"),
        ({"policy_frequency": 7}, "60 ticks a second are a multiple of"),
        ({"reward_weights": [1, 2]}, "give one like [1, 0.3, 0, 0, 0.02, 0.02]"),
        ({"add_walls": 1}, "config 'add_walls' is 1; give one like True"),
    ],
)
def test_what_is_not_a_configuration_is_named(config: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        park(0.0, 0.0, 0.0, **config)
    assert message in str(caught.value)


@pytest.mark.parametrize(
    ("action", "message"),
    [([0.5], "actions of shape (1,): give (2,)"), ([0.5, math.nan], "give finite numbers")],
)
def test_what_is_no_action_is_named(action: list[float], message: str) -> None:
    with pytest.raises(ScenarioError) as caught:
        park(0.0, 0.0, 0.0).step(action)
    assert message in str(caught.value)


def test_what_a_vector_returned_stays_as_it_was_while_it_goes_on() -> None:
    many = gymnasium.make_vec("Kart/ParkCompatible-v0", num_envs=2)
    many.reset(seed=5)
    body = many.unwrapped.cars.batch.world.bodies[0, 0]  # type: ignore[attr-defined]
    body.x, body.y, body.heading, body.speed = 30.0, 0.0, 0.0, 20.0
    _, rewards, over, _, infos = many.step(np.zeros((2, 2)))
    # The first car has crashed, and its next episode has begun; the second one goes on.
    assert (over.tolist(), infos["final_info"]["crashed"].tolist()) == ([True, False],) * 2
    assert rewards[0] < -5.0 < rewards[1]
    assert not infos["crashed"].any()
    kept = rewards.copy()
    many.step(np.ones((2, 2)))
    assert rewards.tolist() == kept.tolist()


def test_a_vector_of_cars_does_what_each_does_alone() -> None:
    name, actions = "Kart/ParkCompatible-v0", [[1.0, 0.3], [-1.0, 0.5], [0.5, -1.0]]
    many = gymnasium.make_vec(name, num_envs=3)
    many.reset(seed=5)
    alone = [gymnasium.make(name, disable_env_checker=True) for _ in range(3)]
    for number, env in enumerate(alone):
        env.reset(seed=5 + number)
    for _ in range(4):
        seen, rewards, over, _, infos = many.step(np.array(actions))
        for number, env in enumerate(alone):
            one, reward, is_over, _, info = env.step(actions[number])
            assert one["observation"].tolist() == seen["observation"][number].tolist()
            assert one["desired_goal"].tolist() == seen["desired_goal"][number].tolist()
            assert reward == pytest.approx(rewards[number])
            assert is_over == over[number]
            assert info["speed"] == infos["speed"][number]


def test_a_car_of_a_vector_begins_again_alone() -> None:
    many: Any = gymnasium.make_vec("Kart/ParkCompatible-v0", num_envs=2)
    many.reset(seed=1)
    body = many.cars.batch.world.bodies[0, 0]
    body.x, body.heading, body.speed = 30.0, 0.0, 20.0
    seen, _, over, _, infos = many.step(np.zeros((2, 2)))
    assert over.tolist() == infos["_final_obs"].tolist() == [True, False]
    assert infos["final_info"]["crashed"].tolist() == [True, False]
    # It ends at the wall, 34.5 m from the middle, and begins in the middle.
    assert 0.28 < infos["final_obs"]["observation"][0, 0] < 0.345
    assert seen["observation"][0, 0] == pytest.approx(0.0, abs=1e-6)


@needs_highway
def test_other_vehicles_of_a_road_are_as_many_as_asked_for() -> None:
    def seen_with(others: int) -> Any:
        config = {"other_vehicles": others}
        many: Any = gymnasium.make_vec("Kart/RacetrackCompatible-v0", num_envs=2, config=config)
        many.reset(seed=1)
        return many.cars.batch.world.bodies

    assert seen_with(0).shape == (2, 1)
    assert seen_with(1).shape == (2, 2)
    with pytest.raises(ScenarioError, match="'other_vehicles' is 9; give 0 to 8"):
        seen_with(9)


def test_the_reward_of_a_decision_is_the_one_that_is_computed_for_its_goals() -> None:
    env = park(0.0, 0.0, 30.0)
    for _ in range(20):
        seen, reward, *_ = env.step([0.4, 0.2])
        assert reward == env.compute_reward(seen["achieved_goal"], seen["desired_goal"], {})
