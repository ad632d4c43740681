"""Reproductions: found by name, told beside the report's figures, driven cell by cell."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from race_agents.reproductions import run, training
from race_agents.reproductions.plan import Exam, Reproduction, TrainingScale, Twist, Variant
from race_agents.reproductions.registry import reproduction_named, reproduction_names
from race_agents.reproductions.reports.report_b_time_trial import seconds_of
from race_agents.reproductions.summary import lines_of, remarks_on
from race_agents.reproductions.table import base_of, page, texts_of
from race_agents.reproductions.training import (
    Training,
    read_outcome,
    run_training,
    trainings_of,
    write_outcome,
)
from race_agents.reproductions.watch import Watch, mean_return
from race_agents.reproductions.world import CHOICES, actions_of
from race_agents.training.budget import Budget
from race_agents.training.learner import learner_of
from race_agents.training.settings import Goal, Tracks
from race_server.envs.racing.reward_terms import REWARDS
from race_server.errors import ScenarioError, TrackError

RESULTS = Path(__file__).parents[2] / "docs" / "results"
TINY = TrainingScale(
    steps=128,
    seeds=1,
    exam_s=2.0,
    changes=(
        "lidar.rays=21",
        "tracks={names = ['oval']}",
        "algorithm.options={n_steps = 64, batch_size = 64, n_epochs = 1}",
    ),
)


def tiny(rows: tuple[Variant, ...]) -> Reproduction:
    """A reproduction of a few seconds."""
    exam = Exam(Tracks(names=("oval",)), alone=True, random_start=False, seeds=2)
    whole = reproduction_named("report-b-algorithms")
    return replace(whole, rows=rows, exam=exam, quick=TINY, full=TINY)


def outcome(row: str, seed: int, **figures: float | None) -> dict[str, Any]:
    """What a cell leaves behind."""
    known = {"reward": 1.0, "speed": 1.0, "crashes_per_minute": 2.0, "laps": 3, "learning_cpu_s": 4}
    curve = [[10, 1.0], [20, 2.0 * seed]]
    return {
        "row": row,
        "seed": seed,
        "steps": 100,
        "figures": {**known, **figures},
        "curve": curve,
    }


# What there is


def test_every_report_has_its_reproductions() -> None:
    assert {
        "highway-env",
        "park-gate",
        "ppo-beside-sb3",
        "report-b-algorithms",
        "report-b-observations",
        "report-b-time-trial",
        "report-b-units",
        "report-a-curriculum",
        "report-a-karts",
        "report-a-parking-aids",
        "report-a-scenario-1",
        "report-a-scenario-2",
        "report-a-transfer",
        "report-c-algorithms",
        "report-c-heuristics",
        "report-c-more-heuristics",
        "report-c-shaping",
    } == set(reproduction_names())


@pytest.mark.parametrize("name", reproduction_names())
def test_every_row_of_a_reproduction_makes_a_training(name: str) -> None:
    plan = reproduction_named(name)
    for scale in (plan.full, plan.quick):
        trainings = trainings_of(plan, scale)
        assert len(trainings) == plan.runs_wanted(scale)
        assert len({training.key for training in trainings}) == len(trainings)
    assert all(len(row.theirs) in (0, len(plan.their_heads)) for row in plan.rows)
    assert len({row.name for row in plan.rows}) == len(plan.rows)
    assert not plan.base or plan.base in {row.name for row in plan.rows}


@pytest.mark.parametrize(
    "name",
    [
        "park-gate",
        "report-a-curriculum",
        "report-a-parking-aids",
        "report-a-scenario-1",
        "report-a-scenario-2",
        "report-a-transfer",
        "report-b-algorithms",
        "report-b-observations",
        "report-b-time-trial",
        "report-b-units",
        "report-c-heuristics",
    ],
)
def test_kept_runs_still_count(name: str) -> None:
    """A setting that is new must not be written where it is not used: digests would be others."""
    plan, store = reproduction_named(name), RESULTS / name / run.CELLS
    found = [
        read_outcome(run._path(store, training), training)
        for training in trainings_of(plan, plan.full)
    ]
    assert sum(one is not None for one in found) == len(list(store.iterdir())) > 0


def test_an_unknown_name_is_answered_with_the_known_ones() -> None:
    with pytest.raises(
        ScenarioError,
        match="'report-d' is unknown; choose one of highway-env, park-gate, ppo-beside-sb3",
    ):
        reproduction_named("report-d")


def test_a_lap_time_is_read_as_the_report_prints_it() -> None:
    assert seconds_of("1:03.74") == pytest.approx(63.74)
    assert seconds_of("none") is None


def test_units_make_the_reward_of_the_1_10_race_four_others() -> None:
    """12 for a share of 12 m is 1 for 1 m, and 3 for 1 km/h are 10.8 for 1 m/s."""
    plan = reproduction_named("report-b-units")
    rewards = [training.settings.reward for training in trainings_of(plan, plan.quick)]
    paid = [(reward["range"], reward["speed"]) for reward in rewards if isinstance(reward, dict)]
    assert paid == [(12.0, 3.0), (12.0, 10.8), (1.0, 3.0), (1.0, 10.8)]
    assert rewards[0] == REWARDS["report_b"]


# The table


def test_a_line_holds_the_mean_of_its_runs_beside_theirs() -> None:
    plan = reproduction_named("report-b-algorithms")
    lines = lines_of(plan, [outcome("PPO", 1, reward=4.0), outcome("PPO", 2, reward=5.0)])
    texts = texts_of(plan, lines[0], None, 10)
    assert texts[:4] == ["PPO", "3.86", "converges fastest", "4.50 ± 0.71"]
    assert texts[-1] == "2 of 10"
    assert texts_of(plan, lines[0], None, 2)[-1] == "2"
    assert lines[0].curve == ((10.0, 1.0, 1.0, 1.0), (20.0, 3.0, 2.0, 4.0))  # mean and range


def test_the_deviation_is_that_of_a_sample() -> None:
    plan = reproduction_named("report-b-algorithms")
    runs = [outcome("PPO", seed, reward=float(seed)) for seed in (1, 2, 3)]
    assert lines_of(plan, runs)[0].spreads["reward"] == 1.0
    assert lines_of(plan, runs[:1])[0].spreads["reward"] == 0.0


def test_a_difference_to_the_base_is_told() -> None:
    plan = replace(reproduction_named("report-b-algorithms"), base="DQN")
    lines = lines_of(plan, [outcome("PPO", 1, reward=7.5), outcome("DQN", 1, reward=10.0)])
    base = base_of(plan, lines)
    assert texts_of(plan, lines[0], base, 1)[3] == "7.50 (-2.50)"
    assert texts_of(plan, lines[1], base, 1)[3] == "10.00"


def test_what_is_worse_in_another_order_or_missing_is_said() -> None:
    plan = reproduction_named("report-b-algorithms")
    rewards = {"PPO": 1.0, "DQN": 3.0, "SAC": None}
    known = [outcome(name, 1, reward=reward) for name, reward in rewards.items()]
    remarks = " ".join(remarks_on(plan, lines_of(plan, known)))
    assert "theirs: PPO, DQN; ours: DQN, PPO (another order)" in remarks
    assert "worse than theirs in mean reward: PPO." in remarks
    assert "come to no mean reward, so they fail: SAC." in remarks


def test_a_quick_page_says_so_and_names_what_is_assumed() -> None:
    plan = reproduction_named("report-b-algorithms")
    lines = lines_of(plan, [outcome("PPO", 1)])
    text = page(plan, plan.quick, lines, {"Made by": "`it`"}, quick=True)
    assert "QUICK: 100 decisions, 1 run" in text
    assert "So far 1 of 8 runs are there; a row says of how many it is the mean" in text
    assert "none of: DQN; SAC; as printed: PPO, never slower." in text
    assert "| PPO | 3.86 | converges fastest | 1.00 |" in text
    assert "- Made by: `it`" in text
    assert "QUICK" not in page(plan, plan.full, lines, {}, quick=False)


# Cells


def test_before_its_first_episode_a_training_earned_what_that_one_did() -> None:
    assert mean_return([(10, 1.0)] * 19 + [(20, 3.0)]) == pytest.approx(1.05)
    assert mean_return([]) is None


def test_a_twist_turns_choices_and_small_steps_into_increments() -> None:
    picked = actions_of(Twist(choices=True), np.array([0, 14]))
    assert picked.tolist() == [[-1.0, -1.0], [1.0, 1.0]]
    assert len(CHOICES) == 15
    small = actions_of(Twist(steering_share=0.5), np.array([[1.0, 1.0]], np.float32))
    assert small.tolist() == [[1.0, 0.5]]


def test_a_reproduction_is_driven_once_and_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    growing = Twist(scaling="largest", growing_crash=True)
    picks = ("algorithm.name=dqn", "action=discrete", "algorithm.options={}")
    plan = tiny((Variant("one", twist=growing, theirs=("1", "slow")),))
    done = run.reproduce("it", plan, tmp_path, quick=True)
    assert done.lines[0].steps == 128
    assert done.lines[0].means["minutes"] == pytest.approx(2 * 2.0 / 60.0)
    document = json.loads((tmp_path / run.FIGURES).read_text())
    assert document["quick"]
    assert document["rows"][0]["theirs"] == ["1", "slow"]
    assert (tmp_path / run.PLOT).stat().st_size > 5000

    driven = []

    def drive(training: Training, _: Any) -> dict[str, Any]:
        driven.append(training.row.name)
        return {**outcome(training.row.name, 1), "key": training.key}

    monkeypatch.setattr(run, "run_training", drive)
    rows = (*plan.rows, Variant("two", picks, Twist(choices=True), theirs=("2", "fast")))
    wider = replace(plan, rows=rows, quick=replace(TINY, changes=TINY.changes[:2]))
    run.reproduce("it", replace(plan, rows=plan.rows), tmp_path, quick=True)
    assert driven == []
    run.reproduce("it", wider, tmp_path, quick=True)
    assert driven == ["one", "two"]  # the first again, as its settings are others now


def test_only_the_rows_and_seeds_that_are_wanted_are_driven(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    driven = []

    def drive(training: Training, _: Any) -> dict[str, Any]:
        driven.append((training.row.name, training.seed))
        return {**outcome(training.row.name, training.seed), "key": training.key}

    monkeypatch.setattr(run, "run_training", drive)
    plan = tiny((Variant("one"), Variant("two"), Variant("three")))
    plan = replace(plan, quick=replace(TINY, seeds=3), their_heads=())
    run.reproduce("it", plan, tmp_path, quick=True, rows="two", seeds=1)
    assert driven == [("two", 1)]
    done = run.reproduce("it", plan, tmp_path, quick=True, seeds=2)
    assert driven[1:] == [("one", 1), ("three", 1), ("one", 2), ("two", 2), ("three", 2)]
    assert [line.runs for line in done.lines] == [2, 2, 2]
    run.reproduce("it", plan, tmp_path, quick=True, rows="One,three")
    done = run.reproduce("it", plan, tmp_path, quick=True, rows="one", seeds=1)
    assert [line.runs for line in done.lines] == [3, 2, 3]
    assert done.document["runs"] == 8
    assert "So far 8 of 9 runs are there" in (tmp_path / run.TABLE).read_text()
    assert "mean ± deviation of 2 to 3 runs" in (tmp_path / run.TABLE).read_text()
    with pytest.raises(ScenarioError, match="--seeds 4: each row has 3"):
        run.reproduce("it", plan, tmp_path, quick=True, seeds=4)


def test_a_row_that_learns_nothing_is_run_once() -> None:
    plan = tiny((Variant("learns"), Variant("bundled", steps_share=0.0)))
    scale = replace(TINY, seeds=3)
    runs = [(one.row.name, one.seed) for one in trainings_of(plan, scale)]
    assert runs == [("learns", 1), ("bundled", 1), ("learns", 2), ("learns", 3)]
    assert plan.runs_wanted(scale) == 4


def test_after_a_training_that_fails_the_others_are_run_and_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def drive(training: Training, _: Any) -> dict[str, Any]:
        if training.row.name == "two":
            raise TrackError("highway-env is not installed")
        return {**outcome(training.row.name, training.seed), "key": training.key}

    monkeypatch.setattr(run, "run_training", drive)
    plan = replace(tiny((Variant("one"), Variant("two"), Variant("three"))), their_heads=())
    with pytest.raises(ScenarioError, match=r"^two, seed 1: highway-env is not installed$"):
        run.reproduce("it", plan, tmp_path, quick=True)
    document = json.loads((tmp_path / run.FIGURES).read_text())
    assert [row["name"] for row in document["rows"]] == ["one", "three"]


def test_a_table_names_the_versions_that_its_runs_were_made_with(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def drive(training: Training, _: Any) -> dict[str, Any]:
        told = {"versions": {"python": "3.11.2", "torch": f"2.{training.seed}"}}
        return {**outcome("one", training.seed), "key": training.key, **told}

    monkeypatch.setattr(run, "run_training", drive)
    plan = replace(tiny((Variant("one"),)), quick=replace(TINY, seeds=2), their_heads=())
    done = run.reproduce("it", plan, tmp_path, quick=True)
    assert done.document["versions"] == {"python": "3.11.2", "torch": "2.1 and 2.2"}


def test_the_clock_of_a_training_stops_at_its_end() -> None:
    training = trainings_of(tiny((Variant("one"),)), TINY)[0]
    watch = Watch(training.settings, Budget.of(training.settings), lambda _: None)
    watch.on_training_end()
    took = watch.cpu_s
    sum(range(1_000_000))
    assert watch.cpu_s == took > 0.0


def test_rows_are_found_by_names_with_commas_and_by_their_beginnings() -> None:
    plan = reproduction_named("report-b-time-trial")
    assert plan.rows_named("PPO 6, ppo 1: base") == (
        "PPO 6: entropy 0.02, steps of 2°",
        "PPO 1: base",
    )
    wide = reproduction_named("report-b-observations")
    names = tuple(row.name for row in wide.rows)
    assert wide.rows_named(",".join(names)) == names
    with pytest.raises(ScenarioError, match="row 'PPO' is not the only one; choose from PPO 1"):
        plan.rows_named("PPO")
    with pytest.raises(ScenarioError, match="row 'A2C' is unknown; choose from PPO 1: base; PPO 2"):
        plan.rows_named("PPO 2,A2C")


def test_a_cell_stays_known_when_what_it_does_not_use_changes() -> None:
    training = trainings_of(tiny((Variant("one"),)), TINY)[0]
    trained = training.settings.model_copy(update={"goal": Goal(speed=3.0)})
    assert replace(training, settings=trained).key == training.key
    others = training.settings.model_copy(update={"worlds": 7})
    assert replace(training, settings=others).key != training.key


def test_a_preset_that_learns_otherwise_makes_no_reproduction() -> None:
    taught = ("warm_start.teacher=raceline",)
    with pytest.raises(ScenarioError, match="has warm_start: a reproduction learns by the race's"):
        trainings_of(tiny((Variant("one", taught),)), TINY)


def test_dqn_learns_to_pick_increments() -> None:
    picks = ("algorithm.name=dqn", "action=discrete")
    scale = replace(TINY, changes=(*TINY.changes[:2], "algorithm.options={learning_starts = 32}"))
    row = Variant("dqn", picks, Twist(scaling="largest", choices=True))
    plan = replace(tiny((row,)), quick=scale)
    found = run_training(trainings_of(plan, scale)[0])
    assert found["steps"] == 128
    assert found["figures"]["speed"] > 0.0


def test_the_deviation_of_a_row_falls_to_the_one_that_it_asks_for(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """At the second of two rollouts half of the way from 0 to -3 is over."""
    learners: list[Any] = []

    def noticed(*arguments: Any) -> Any:
        learners.append(learner_of(*arguments))
        return learners[-1]

    monkeypatch.setattr(training, "learner_of", noticed)
    falls = ("worlds=1", "network.log_std=0.0", "network.last_log_std=-3.0")
    run_training(trainings_of(tiny((Variant("one", falls),)), TINY)[0])
    assert learners[0].policy.log_std.tolist() == [-1.5, -1.5]


@pytest.mark.parametrize("name", ["park-gate", "report-c-heuristics"])
def test_runs_that_learned_their_deviation_are_of_settings_without_a_last_one(name: str) -> None:
    plan = reproduction_named(name)
    trainings = trainings_of(plan, plan.full)
    assert {one.settings.network.last_log_std for one in trainings} == {None}


def test_a_damaged_cell_is_driven_again(tmp_path: Path) -> None:
    plan = tiny((Variant("one"),))
    training = trainings_of(plan, TINY)[0]
    path = tmp_path / "one.json"
    assert read_outcome(path, training) is None
    write_outcome(path, {"key": training.key})
    assert read_outcome(path, training) == {"key": training.key}
    path.write_text('{"key": ')
    assert read_outcome(path, training) is None
