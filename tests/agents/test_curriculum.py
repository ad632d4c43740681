"""The curriculum: stages end by success, at the latest at their share of the training."""

from typing import Any

import numpy as np
import pytest

from race_agents.training import curve
from race_agents.training.budget import Budget
from race_agents.training.callback import CURVE
from race_agents.training.curriculum import Curriculum
from race_agents.training.learner import world_of
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from race_server.envs.sb3 import KartVecEnv
from race_server.errors import ScenarioError
from support.trainings import QUICK, Train

TWO = "tracks={names = ['oval', 'oval-reversed']}"
FIRST = "tracks = ['oval'], until_success = 0.5, episodes = 4"


def settings(first: str = FIRST, *changes: str) -> Settings:
    stages = f"curriculum=[{{after = 0.0, {first}}}, {{after = 0.8}}]"
    return read_settings("time-trial-ppo", [*QUICK, "worlds=1", TWO, stages, *changes])


def episode(*, laps: int = 1, crashes: int = 0, steps: int = 10) -> dict[str, Any]:
    return {"l": steps, "laps": laps, "crashes": crashes}


def begun(wanted: Settings) -> tuple[Curriculum, Budget]:
    """Return a curriculum that has told of its first stage."""
    budget = Budget.of(wanted)
    stages = Curriculum(wanted, budget)
    assert stages(0, []) == [1.0, 0.0]
    return stages, budget


def test_a_stage_ends_once_enough_of_its_last_episodes_succeed_and_not_before() -> None:
    stages, _ = begun(settings())
    crash, no_lap, success = episode(crashes=1), episode(laps=0), episode()
    for turn, one in enumerate((crash, no_lap, crash, success), 1):
        assert stages(20 * turn, [one]) is None  # too few, or one of four
    assert str(stages) == "stage 1 of 2, 25 % succeed"
    assert stages(100, [success]) == [1.0, 1.0]  # two of the last four
    assert stages(120, [crash] * 9) is None  # no stage comes back
    assert str(stages) == "stage 2 of 2"


def test_a_stage_ends_at_its_share_at_the_latest() -> None:
    stages, budget = begun(settings())
    assert budget.steps is not None
    budget.done = round(0.79 * budget.steps)
    assert stages(100, [episode(crashes=1)]) is None
    budget.done = round(0.8 * budget.steps)
    assert stages(200, [episode(crashes=1)]) == [1.0, 1.0]


def test_an_episode_that_began_before_the_stage_does_not_count() -> None:
    first = "tracks = ['oval'], until_success = 1.0, episodes = 1"
    stages = f"curriculum=[{{after = 0.0, {first}}}, {{after = 0.7, {first}}}, {{after = 0.8}}]"
    curriculum, _ = begun(settings(FIRST, stages))
    assert curriculum(20, [episode()]) == [1.0, 0.0]
    assert curriculum(25, [episode(steps=15)]) is None
    assert curriculum.number == 2
    assert curriculum(26, [episode(steps=5)]) == [1.0, 1.0]


def test_a_curriculum_goes_on_where_it_was() -> None:
    stages, _ = begun(settings())
    stages(20, [episode(), episode(crashes=1), episode(crashes=1)])
    again = Curriculum(settings(), Budget.of(settings()))
    again.restore(stages.state())
    assert again(0, []) == [1.0, 0.0]
    assert again(20, [episode()]) == [1.0, 1.0]


def stages_after(steps: int, drive: float, episode_steps: int) -> list[tuple[int, set[int]]]:
    """Return after each decision which stage runs, and the tracks that sixteen karts are on."""
    first = "tracks = ['oval'], until_success = 0.9, episodes = 24, success_laps = 0"
    wanted = settings(first, "worlds=16", f"episode.steps={episode_steps}", "gap={}")
    world = world_of(wanted, Budget.of(wanted))
    karts: KartVecEnv = world.unwrapped  # type: ignore[assignment]
    stages = karts.curriculum
    assert isinstance(stages, Curriculum)
    world.reset()
    found = []
    for _ in range(steps):
        world.step(np.tile(np.float32([drive, 0.0, 0.0]), (16, 1)))
        found.append((stages.number, set(karts.batch.buffers.rounds["scenario"].tolist())))
    world.close()
    return found


def test_karts_that_crash_nowhere_leave_the_first_stage_and_get_both_tracks() -> None:
    told = stages_after(60, drive=-1.0, episode_steps=20)
    assert {number for number, _ in told[:39]} == {1}  # sixteen episodes of twenty-four
    assert told[39][0] == 2
    assert all(tracks == {0} for _, tracks in told[:59])
    assert told[59][1] == {0, 1}


def test_karts_that_crash_stay_in_the_first_stage() -> None:
    assert {number for number, _ in stages_after(250, drive=1.0, episode_steps=100)} == {1}


def test_the_curve_tells_which_stage_ran(trained: Train) -> None:
    stages = "curriculum=[{after = 0.0, tracks = ['oval']}, {after = 0.7}]"
    outcome = trained("time-trial-ppo", (*QUICK, TWO, stages))
    rows = curve.read(outcome.folder / CURVE)
    assert [row["stage"] for row in rows] == sorted(row["stage"] for row in rows)
    assert {rows[0]["stage"], rows[-1]["stage"]} == {1.0, 2.0}


def test_a_stage_that_names_a_foreign_track_is_refused() -> None:
    with pytest.raises(ScenarioError, match="curriculum: 'moon' is not trained on; choose from"):
        Curriculum(settings("tracks = ['moon']"), Budget.of(settings()))
