"""highway-env's documented examples, with our environments in their place."""

from typing import Any

import gymnasium
import numpy as np
import pytest

import race_server.envs  # noqa: F401  # registers the ids
from race_agents.reproductions import documented
from race_agents.reproductions.documented import HindsightExample, Lap
from race_agents.reproductions.many_cars import ManyCars
from race_agents.reproductions.registry import reproduction_named
from race_agents.reproductions.training import trainings_of
from race_server.envs.registration import PARK_COMPATIBLE
from race_server.errors import ScenarioError
from race_server.scenario import highway


class Road(gymnasium.Env[Any, Any]):
    """Leaves the road in a given decision."""

    def __init__(self, leaves: int) -> None:
        self.leaves, self.decisions = leaves, 0

    def reset(self, **_: Any) -> tuple[Any, dict[str, Any]]:
        self.decisions = 0
        return 0, {}

    def step(self, action: Any) -> tuple[Any, float, bool, bool, dict[str, Any]]:
        self.decisions += 1
        return 0, 1.0, self.decisions == self.leaves, False, {"crashed": False}


def test_a_lap_is_a_success_and_ends_the_episode(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(documented, "decisions_of_a_lap", lambda: 3)

    def drive(leaves: int) -> list[tuple[bool, bool, bool]]:
        env = Lap(Road(leaves))
        env.reset()
        outcomes = [env.step(0) for _ in range(min(leaves, 3))]
        return [(over, cut, info["is_success"]) for _, _, over, cut, info in outcomes]

    on = (False, False, False)
    assert drive(leaves=4) == [on, on, (False, True, True)]
    assert drive(leaves=3) == [on, on, (True, False, False)]


@pytest.mark.slow
def test_many_cars_are_told_of_the_end_of_one() -> None:
    vector: Any = gymnasium.make_vec(PARK_COMPATIBLE, num_envs=2)
    cars = ManyCars(vector)
    cars.seed(1)
    cars.reset()
    body = vector.cars.batch.world.bodies[1, 0]
    body.x, body.heading, body.speed = 30.0, 0.0, 20.0
    seen, rewards, done, infos = cars.step(np.zeros((2, 2), np.float32))
    assert done.tolist() == [False, True]
    assert infos[0] == {}
    assert infos[1]["crashed"]
    assert not infos[1]["TimeLimit.truncated"]
    assert infos[1]["terminal_observation"]["observation"][0] > 0.28
    assert seen["observation"][1, 0] == pytest.approx(0.0, abs=1e-6)
    assert rewards[1] < -5.0
    (relabelled,) = cars.env_method(
        "compute_reward", seen["achieved_goal"], seen["achieved_goal"], []
    )
    assert relabelled.tolist() == [0.0, 0.0]


@pytest.mark.slow
def test_the_example_that_parks_runs_in_our_car_park() -> None:
    plan = reproduction_named("highway-env")
    training = trainings_of(plan, plan.quick)[1]
    settings = training.settings.model_copy(update={"steps": 40})
    found = HindsightExample(PARK_COMPATIBLE).give(settings, 1, lambda _: None)
    assert (found.steps, found.figures["starts"]) == (40, 1)
    assert found.figures["decisions_a_second"] > 0.0


def test_the_documentations_numbers_are_those_of_the_full_run() -> None:
    plan = reproduction_named("highway-env")
    parks, *_, road = trainings_of(plan, plan.full)
    assert parks.settings.steps == 20_000
    assert parks.settings.network.layers == (512, 512, 512)
    assert parks.settings.algorithm.options["batch_size"] == 1024
    assert (road.settings.steps, road.settings.worlds) == (100_000, 6)


def test_without_highway_env_its_examples_say_what_to_install(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(highway, "has_highway", lambda: False)
    with pytest.raises(ScenarioError, match=r"race-server\[bench\]"):
        documented.make_example("parking-v0", {})
