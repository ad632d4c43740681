"""Settings, curricula and demonstrations of a training in a lot."""

import inspect
import math
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from race_agents.commands.exam_parking import ParkingOptions
from race_agents.training.budget import Budget
from race_agents.training.cloning import Cloning
from race_agents.training.companion_callbacks import callbacks_beside
from race_agents.training.curriculum import Curriculum
from race_agents.training.demonstrations import (
    pairs_for,
)
from race_agents.training.evaluation import Examiner
from race_agents.training.parking_marks import ParkingMarks
from race_agents.training.settings import Goal, Settings
from race_agents.training.settings_toml import read_settings
from race_agents.training.tasks import training_task, validation_courses
from race_agents.training.teacher import actions_of
from race_agents.training.view import ObservationView
from race_server.competition.parking_exam import ExamSpec
from race_server.core.seeds import HELD_OUT, RESUMED
from race_server.core.vehicle_presets import KART_13
from race_server.core.vehicles import vehicle_record
from race_server.envs.actions import BRAKED, PEDAL, Driven, discrete_table, read_action
from race_server.envs.batch import Batch
from race_server.envs.presets import parking_task
from race_server.errors import ScenarioError
from race_server.scenario.lot.load import load_lot
from race_server.scenario.lot.nearer import at_distance
from support.lot_trainings import FAR, NEAR, settings, write_shown
from support.trainings import untrained


def examined(wanted: Settings, action: Sequence[float]) -> ParkingMarks:
    """Return the marks of a policy that always answers the same."""
    examiner = Examiner(wanted, validation_courses(wanted), 1)
    marks = examiner.examine(lambda seen: np.tile(np.float32(action), (len(seen), 1)))
    examiner.close()
    assert isinstance(marks[-1], ParkingMarks)
    return marks[-1]


def test_who_drives_straight_ahead_parks_in_the_slot_5_m_ahead() -> None:
    marks = examined(settings("parking.limit_s=30.0"), [1.0, 0.0])
    assert (marks.tally.success_rate, marks.tally.aligned_rate, marks.hits) == (1.0, 1.0, 0.0)
    assert marks.score("success") == 1.0
    assert marks.reward == pytest.approx(1.5 + 0.03 * 4.5, abs=0.15)  # parked, aligned, 4.5 m
    assert str(marks) == "100.0 % park, 100.0 % aligned, 0 collisions and 0 hits of people in 3"
    assert marks.reaches(Goal(parked=0.99, hits=0.0))
    assert not marks.reaches(Goal())


def test_who_stands_is_late_and_who_turns_hits_a_wall() -> None:
    standing = examined(settings(), [0.0, 0.0])
    assert (standing.tally.failures, standing.score("success")) == ({"late": 3}, 0.0)
    turning = examined(settings("parking.limit_s=30.0"), [1.0, 0.5])
    assert turning.tally.failures == {"wall": 3}
    assert turning.hits == 1.0
    assert not turning.reaches(Goal(hits=0.5))


def test_a_touch_that_ends_nothing_while_learning_ends_the_way_in_an_evaluation() -> None:
    bumps = settings('race.rules={wall_contact = "bump", kart_contact = "bump"}')
    learned = training_task(bumps).scenarios[0].rules
    assert (learned.wall_contact, learned.kart_contact) == ("bump", "bump")
    assert examined(bumps, [1.0, 0.5]).tally.failures == {"wall": 3}


def test_a_lot_has_its_own_pace_and_a_race_that_of_a_live_one() -> None:
    assert settings().decision_s == 0.1
    assert settings("parking.decision_ticks=3").decision_s == 0.05
    assert read_settings("time-trial-ppo").decision_s == 0.05


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("evaluation.score=speed", "choose success or return"),
        ("warm_start.teacher=raceline", "a driver follows a track's line"),
        ("algorithm.name=sac", "only ppo and poca can imitate beside"),
    ],
)
def test_what_only_races_have_is_refused_in_a_lot(change: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        settings("cloning.demonstrations=x.npz", change)


def test_vehicles_start_as_near_to_their_slots_as_a_stage_asks() -> None:
    course = at_distance(load_lot("yard-70"), (3.0, 8.0))
    assert course.lot is not None
    task = parking_task("yard-70")
    (scenario,) = task.scenarios
    near = replace(
        task, scenarios=(replace(scenario, course=course),), observation=("goal_distance",)
    )
    batch = Batch(near, worlds=40, seed=5)
    metres = batch.observations.ravel()
    # What finds no place in 32 tries stays where the last one was.
    assert ((metres >= 3.0) & (metres < 8.0)).sum() >= 37
    assert metres.max() < 40.0
    batch.close()


def episode(*, parks: bool, steps: int = 10) -> dict[str, Any]:
    return {"l": steps, "is_success": parks}


def test_a_curriculum_by_distance_goes_on_once_enough_park() -> None:
    wanted = settings("worlds=1", f"curriculum=[{NEAR}, {FAR}]")
    assert len(training_task(wanted).scenarios) == 2
    stages = Curriculum(wanted, Budget.of(wanted))
    assert stages(0, []) == [1.0, 0.0]
    assert stages(20, [episode(parks=False)]) is None
    assert stages(40, [episode(parks=False)]) is None
    assert str(stages) == "stage 1 of 2, 0 % succeed"
    assert stages(60, [episode(parks=True)]) == [0.0, 1.0]


def test_a_curriculum_by_lots_draws_only_those_of_its_stage() -> None:
    lots = "parking.lots=['face-to-face', 'zone-30']"
    wanted = settings(lots, "curriculum=[{after = 0.0, lots = ['zone-30']}]")
    assert Curriculum(wanted, Budget.of(wanted))(0, []) == [0.0, 1.0]
    for stage, message in (
        ("{after = 0.0, lots = ['kerb']}", "'kerb' is not trained on"),
        ("{after = 0.0, tracks = ['oval']}", "'oval' is not trained on"),
    ):
        wrong = settings(lots, f"curriculum=[{stage}]")
        with pytest.raises(ScenarioError, match=message):
            Curriculum(wrong, Budget.of(wrong))
    racing = read_settings("time-trial-ppo", [f"curriculum=[{NEAR}]"])
    with pytest.raises(ScenarioError, match=r"without parking\.lots"):
        Curriculum(racing, Budget.of(racing))


def test_an_action_of_a_demonstration_gives_its_control_again() -> None:
    """Ahead, braking ahead, in reverse, braking in reverse; steering, throttle, brake, buttons."""
    controls = np.array(
        [(0.2, 0.7, 0.0, 0.0), (0.0, 0.0, 0.5, 0.0), (-0.4, -0.6, 0.0, 0.0), (0.0, 0.0, 0.3, 0.0)]
    )
    speeds = np.array([2.0, 2.0, -1.0, -1.0])
    wanted = [(0.7, 0.2), (-0.5, 0.0), (-0.6, -0.4), (0.3, 0.0)]
    pedal = actions_of(controls, PEDAL, speeds)
    assert pedal == pytest.approx(np.array(wanted))
    kart, read = vehicle_record(KART_13)[0], np.zeros(4)
    for action, speed, control in list(zip(pedal, speeds, controls, strict=True))[:3]:
        read_action(PEDAL, action, discrete_table(), Driven(speed, 0, 0), kart, np.zeros(5), read)
        assert read == pytest.approx(control)
    assert actions_of(controls, BRAKED, speeds) == pytest.approx(controls[:, [1, 0, 2]])


def test_cloning_beside_ppo_pulls_answers_to_the_demonstrations_and_fades(tmp_path: Path) -> None:
    shown = write_shown(tmp_path / "shown.npz", steering=0.8)
    wanted = settings(f"cloning={{demonstrations = '{shown}', steps = 1000, lessons = 60}}")
    budget, world, learner = untrained(wanted)
    world.reset()
    cloning = Cloning(wanted, world, budget)
    cloning.init_callback(learner)
    rows = world.normalize_obs(cloning._seen)
    assert cloning.strength == 0.5
    budget.done = 500
    assert cloning.strength == 0.25

    def error() -> float:
        return float(np.abs(learner.predict(rows, deterministic=True)[0] - [0.5, 0.8]).mean())

    before = error()
    for _ in range(4):
        cloning.on_rollout_start()
    assert error() < 0.6 * before
    budget.done = 1000
    at_the_end = error()
    cloning.on_rollout_start()
    assert (cloning.strength, error()) == (0.0, at_the_end)
    world.close()


def test_cloning_waits_while_the_critic_learns_alone(tmp_path: Path) -> None:
    shown = write_shown(tmp_path / "shown.npz", steering=0.8)
    cloned = f"cloning={{demonstrations = '{shown}', steps = 1000}}"
    wanted = settings(cloned, "steps=1000", "warm_start={policy = 'park', critic_share = 0.5}")
    budget, world, learner = untrained(wanted)
    world.reset()
    beside, weight = callbacks_beside(wanted, world, budget), learner.policy.action_net.weight
    before, has_changed = weight.clone(), []
    for callback in beside:
        callback.init_callback(learner)
    for budget.done in (499, 500):
        for callback in beside:
            callback.on_rollout_start()
        has_changed.append(not weight.equal(before))
    assert has_changed == [False, True]
    world.close()


def test_of_demonstrations_at_twice_the_pace_every_second_pair_teaches(tmp_path: Path) -> None:
    wanted = settings()
    all_pairs = pairs_for(wanted, write_shown(tmp_path / "all.npz", steering=0.8))
    fast = write_shown(tmp_path / "fast.npz", steering=0.8, decision_s=0.05)
    seen, actions = pairs_for(wanted, fast)
    assert np.array_equal(seen, all_pairs[0][::2])
    assert np.array_equal(actions, all_pairs[1][::2])


def test_demonstrations_of_another_pace_are_refused(tmp_path: Path) -> None:
    shown = write_shown(tmp_path / "shown.npz", steering=0.0, decision_s=0.07)
    wanted = settings(f"cloning.demonstrations={shown}")
    budget, world, _ = untrained(wanted)
    with pytest.raises(ScenarioError, match=r"decision_s = 0\.07, the training's is 0\.1"):
        Cloning(wanted, world, budget)
    world.close()


def test_a_network_sees_logarithms_of_the_radar_up_to_80_m() -> None:
    view = ObservationView.of(settings("observation=['radar', 'speed']", "parking.logarithms=true"))
    seen = np.float32([[1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 80.0, 100.0, 3.0]])
    wanted = [*np.log([1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0, 80.0, 80.0]), 3.0]
    assert view(seen)[0] == pytest.approx(wanted)


def test_a_network_sees_the_last_metre_to_the_slot_as_large_as_several_before_it() -> None:
    view = ObservationView.of(
        settings("observation=['goal_x', 'speed']", "parking.logarithms=true")
    )
    seen = np.float32([[0.0, 3.0], [math.e - 1.0, 3.0], [-(math.e**4 - 1.0), 3.0]])
    assert view(seen)[:, 0] == pytest.approx([0.0, 1.0, -4.0], abs=1e-6)
    assert view(seen)[:, 1] == pytest.approx([3.0] * 3)
    assert view.undone(view(seen)) == pytest.approx(seen, rel=1e-6)


def test_no_training_in_a_lot_draws_the_seeds_of_an_exam() -> None:
    assert min(ExamSpec("2").seeds) > HELD_OUT
    assert inspect.signature(ParkingOptions).parameters["first_seed"].default > HELD_OUT
    for seed, whose in ((HELD_OUT - 3, "exams"), (9_998, "evaluation"), (110_002, "last evalu")):
        with pytest.raises(ScenarioError, match=f"seeds {seed} to {seed + 3}, .* {whose}"):
            settings(f"seed={seed}")
    assert settings(f"seed={HELD_OUT - 4}").seed == HELD_OUT - 4  # and three more worlds
    assert RESUMED > HELD_OUT + 10**9


def test_a_teacher_shows_no_seed_of_an_exam() -> None:
    """The teacher's four worlds have the seeds behind those of the four that learn."""
    taught = ("warm_start.teacher=planner", "action=crawl")
    assert settings(f"seed={HELD_OUT - 8}", *taught).seed == HELD_OUT - 8
    sentence = f"its worlds and its teacher's have the seeds {HELD_OUT - 7} to {HELD_OUT}, .* exams"
    with pytest.raises(ScenarioError, match=sentence):
        settings(f"seed={HELD_OUT - 7}", *taught)
