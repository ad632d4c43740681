"""What no environment can do is refused with one error that names the thing and the value."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from race_server.envs import Batch, KartRace, RealityGap, parallel_env
from race_server.envs.parking.single import park_goal, park_trailer_goal
from race_server.envs.presets import mixed_task, parking_task, race_task, time_trial_task
from race_server.envs.single import OneKart
from race_server.errors import RaceError, ScenarioError
from support.tasks import ring_task


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"decision_ticks": 2.5}, "decision_ticks = 2.5: choose a whole number, 1 at least"),
        ({"most_steps": 2.9}, "most_steps = 2.9: choose a whole number, 0 at least"),
        ({"most_steps": math.nan}, "most_steps = nan: choose a whole number"),
        ({"learners": 1.5}, "learners = 1.5: choose a whole number"),
        ({"random_start": 7}, "random_start = 7: choose 0 to 1"),
        ({"random_start": "x"}, "random_start = 'x': choose 0 to 1"),
        ({"crash_range": math.nan}, "crash_range = nan: choose a number, 0 at least"),
        ({"crash_range": -1}, "crash_range = -1: choose a number, 0 at least"),
        ({"reward": {"progress": "a"}}, "reward progress = 'a': give a number"),
        ({"reward": 3}, "reward = 3: give the name of a table, or weights"),
        ({"gap": {"mass": (1, 2)}}, "gap = {'mass': .*: give a RealityGap"),
        ({"opponents": "avoider"}, r"opponents = 'avoider': give a list of drivers"),
        ({"observation": ("speed", "speed", "spin")}, "part 'speed' is given twice"),
        ({"observation": ("speed", "spin")}, "choose some of lidar"),
        ({"observation": ()}, r"observation parts \(\): choose some of"),
    ],
)
def test_a_task_is_refused_for_what_is_wrong_with_it(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        Batch(race_task("oval", karts=2, **options))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"limit_s": "10"}, "time limit '10' s: choose 1 to 3600 s"),
        ({"level": ["x"]}, r"level \['x'\] is unknown; choose one of"),
        ({"vehicle": 3}, "vehicle 3 is unknown; choose one of"),
    ],
)
def test_a_task_of_parking_is_refused_for_what_is_wrong_with_it(
    options: dict[str, Any], message: str
) -> None:
    with pytest.raises(RaceError, match=message):
        parking_task("gate", **options)


@pytest.mark.parametrize("make", [park_goal, park_trailer_goal])
def test_an_environment_with_goals_takes_no_other_observation(make: Callable[..., Any]) -> None:
    with pytest.raises(ScenarioError, match=r"observation = 'park': .* has its own; leave it out"):
        make(observation="park")


def test_an_option_that_no_task_has_is_named_with_those_that_it_has() -> None:
    with pytest.raises(TypeError, match=r"task of racing has no option 'trak'; it has, .*reward"):
        time_trial_task(trak="oval")
    with pytest.raises(TypeError, match="a task of parking has no option 'lotto'"):
        parking_task(lotto="gate")


def test_a_vehicle_that_cannot_lap_a_course_is_refused_before_it_drives() -> None:
    message = "course covapsy-train-2023: 0.90 m wide at the narrowest; kart-60 needs 1.99 m"
    with pytest.raises(ScenarioError, match=message):
        time_trial_task(vehicle="kart-60")


def test_an_episode_that_is_over_takes_no_further_step() -> None:
    env = OneKart(time_trial_task("oval", most_steps=2))
    for _ in range(2):
        env.step([0.0, 0.0, 0.0])
    with pytest.raises(ScenarioError, match="the episode is over: call reset"):
        env.step([0.0, 0.0, 0.0])
    env.reset(seed=1)
    env.step([0.0, 0.0, 0.0])


@pytest.mark.parametrize("name", ["mass", "grip", "actuator_lag", "steering_play", "stiffness"])
@pytest.mark.parametrize("most", [math.inf, 1e300, math.nan])
def test_a_reality_gap_ends_somewhere(name: str, most: float) -> None:
    gap = RealityGap(**{name: (1.0, most)})
    with pytest.raises(ScenarioError, match=f"reality gap {name} from 1 to .*: choose low to high"):
        Batch(ring_task(1, gap=gap))


@pytest.mark.parametrize("share", [0.05, 20.0])
def test_a_kart_stays_a_thing_of_numbers_at_both_ends_of_its_gap(share: float) -> None:
    names = ("mass", "grip", "stiffness", "speed_coefficient")
    for one in (dict.fromkeys(names, share), *({name: share} for name in names)):
        gap = RealityGap(**{name: (value, value) for name, value in one.items()})
        batch = Batch(ring_task(1, gap=gap))
        for _ in range(100):
            batch.step([[[1.0, 0.3, 0.0]]])
        assert np.isfinite(batch.observations).all()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: parallel_env(track="oval", karts=0), "karts = 0: choose a whole number, 1 to 64"),
        (lambda: parallel_env(track="oval", karts=1.5), "karts = 1.5: choose a whole number"),
        (lambda: parallel_env(track="oval", karts=65), "karts = 65: choose a whole number"),
        (lambda: mixed_task("oval", karts=3, learners="two"), "learners = 'two'"),
        (lambda: KartRace(ring_task(2), max_cycles=-3), "max_cycles = -3: .*, 0 at least"),
        (lambda: Batch(ring_task(2), after=9), "after = 9: choose a whole number, 0 to 2"),
        (lambda: Batch(ring_task(2), worlds=1.5), "worlds = 1.5: choose a whole number"),  # type: ignore[arg-type]
        (lambda: Batch(parking_task("gate", vehicles=0)), "karts = 0"),
        (lambda: Batch(ring_task(2)).set_odds(3.0), "weights 3.0: give one for each of the 1"),  # type: ignore[arg-type]
        (lambda: Batch(ring_task(2)).set_odds(["a"]), r"weights \['a'\]: give one for each"),  # type: ignore[list-item]
    ],
)
def test_what_makes_no_batch_is_refused(make: Callable[[], Any], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        make()


@pytest.mark.parametrize(
    ("asked", "message"),
    [
        ({"seed": 1.5}, "seed = 1.5: give a whole number"),
        ({"seed": "a"}, "seed = 'a': give a whole number"),
        ({"seed": [1.5]}, "seed = 1.5: give a whole number"),
        ({"options": [1]}, r"reset options \[1\]: give them by name"),
        ({"options": {"grid": [0.5, 1]}}, r"grid = \[0.5, 1\]: give a place for each kart"),
        ({"options": {"gap": {"mass": "x"}}}, "gap mass = 'x': choose 0.05 to 20"),
        ({"options": {"gap": {"mass": [1, 2]}}}, r"gap mass = \[1, 2\]: choose 0.05 to 20"),
        ({"options": {"gap": {"mass": math.inf}}}, "gap mass = inf: choose 0.05 to 20"),
        ({"options": {"course": "nope"}}, "'nope' is not one of the task"),
    ],
)
def test_a_reset_that_is_refused_has_changed_nothing(asked: dict[str, Any], message: str) -> None:
    def next_round(*, is_asked: bool) -> bytes:
        race = KartRace(ring_task(2, random_start=True))
        race.reset(seed=1)
        if is_asked:
            with pytest.raises(ScenarioError, match=message):
                race.reset(**{"seed": 99, **asked})
        race.reset()
        return race.batch.world.bodies.tobytes()

    assert next_round(is_asked=True) == next_round(is_asked=False)


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (np.zeros((1, 3)), r"action of kart_1 of shape \(1, 3\): give \(3,\)"),
        (np.zeros((3, 1)), r"action of kart_1 of shape \(3, 1\): give \(3,\)"),
        (np.array([1j, 0, 0]), "give numbers"),
        (["0", "0", "0"], "give numbers"),
        (np.array([1e300, 0, 0]), r"inf at \[.*\]: give finite numbers"),
        ([0, -1e300, 0], r"-inf at \[.*\]: give finite numbers"),
    ],
)
def test_an_action_of_another_kind_is_refused(wrong: Any, message: str) -> None:
    race = KartRace(ring_task(2))
    race.reset(seed=1)
    for others in ({"kart_0": np.zeros(3)}, {}):
        with pytest.raises(ScenarioError, match=message):
            race.step({**others, "kart_1": wrong})
    both = {"kart_0": np.zeros((1, 3)), "kart_1": np.zeros((1, 3))}
    with pytest.raises(ScenarioError, match="action of kart_0 of shape"):
        race.step(both)


def test_an_action_of_no_agent_is_refused_and_one_of_an_agent_that_is_done_is_not_needed() -> None:
    race = KartRace(ring_task(2))
    race.reset(seed=1)
    with pytest.raises(ScenarioError, match="action of 'kart_9': choose of kart_0, kart_1"):
        race.step({"kart_9": np.zeros(3)})
    with pytest.raises(ScenarioError, match="action of 'kart_9'"):
        race.step({"kart_0": np.zeros(3), "kart_9": np.zeros(3)})  # in place of kart_1's
    for nothing in (None, [np.zeros(3)] * 2):
        with pytest.raises(
            ScenarioError, match=r"actions .*: give a dictionary, an action by agent"
        ):
            race.step(nothing)  # type: ignore[arg-type]
    race.agents = ["kart_1"]
    race.step({"kart_0": np.zeros(3), "kart_1": np.zeros(3)})


def test_a_share_may_be_yes_or_no() -> None:
    assert time_trial_task("oval", random_start=True).discipline.settings["random_start"] == 1
