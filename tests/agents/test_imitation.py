"""Imitation: a teacher's answers are learned, demonstrations are kept, checked and learned from."""

from pathlib import Path

import numpy as np
import pytest
import torch

from race_agents.planning.latency import LATENCY
from race_agents.training import callback
from race_agents.training.budget import Budget
from race_agents.training.imitation import School
from race_agents.training.learner import learner_of, world_of
from race_agents.training.run import train
from race_agents.training.schedule import Schedule
from race_agents.training.supervised import Memory, SupervisedSteps, loss_of
from race_agents.training.teacher import actions_of, controls_of
from race_server.core.kernel_driver import SHIFT
from race_server.envs.actions import CONTINUOUS, CONTROL
from race_server.errors import RaceError, ScenarioError
from support.trainings import untrained
from support.warm_starts import imitate, settings


def test_a_teacher_looks_at_what_the_learner_does_not_see() -> None:
    school = School(settings(), lambda _: None)
    seen, labels = school.look(44)
    assert school.batch.layout.size > 100
    assert seen.shape == (16, 44)
    assert labels.shape == (16, 3)
    assert np.abs(labels[:, :2]).max() > 0.1
    assert np.abs(labels).max() <= 1.0


def test_controls_become_what_a_learner_would_answer() -> None:
    controls = np.array([[0.5, 0.8, 0.0, 0.0], [-0.2, 0.0, 0.6, 1.0], [0.0, 0.0, 1.0, 0.0]])
    speeds = np.array([2.0, 2.0, 0.0])
    # A learner that brakes while standing would drive backwards.
    wanted = [[0.8, 0.5, 0.0], [-0.6, -0.2, 1.0], [0.0, 0.0, 0.0]]
    assert actions_of(controls, CONTINUOUS, speeds) == pytest.approx(np.array(wanted))
    assert actions_of(controls, CONTROL, speeds) == pytest.approx(controls)


@pytest.mark.parametrize("kind", [CONTINUOUS, CONTROL])
def test_what_is_answered_becomes_controls_again(kind: int) -> None:
    controls = np.array([[0.5, 0.8, 0.0, 0.0], [-0.2, 0.0, 0.6, 1.0]])
    answers = actions_of(controls, kind, np.array([2.0, 2.0]))
    assert controls_of(answers, kind) == pytest.approx(controls[:, :3])


def test_a_teacher_that_takes_advice_shows_what_it_then_does() -> None:
    slower = "warm_start.advice=[0.0, -1.0, 0.0, 0.0, 0.0, 0.0]"
    plain, advised = (School(settings(*more), lambda _: None) for more in ((), (slower,)))
    for _ in range(40):
        _, labels = plain.look(44)
        _, slowly = advised.look(44)
        for school in (plain, advised):
            school.move(labels)
    assert slowly[:, 0].mean() < labels[:, 0].mean() - 0.1


def test_a_teacher_believes_wheels_that_do_what_the_learner_wants() -> None:
    school = driven_at_random()
    assert (school.teacher.memory[..., LATENCY] == 0.0).all()


def test_a_teacher_is_in_a_lane_beside_the_learner() -> None:
    near = [
        (lanes_apart(driven_at_random(*change)) < 0.2).mean()
        for change in ((), ("warm_start.lane_reach=0.1",))
    ]
    assert near[0] < 0.7 < near[1]


def lanes_apart(school: School) -> np.ndarray:
    """Return how far [m] each learner is beside the lane of its teacher."""
    offsets = school.batch.observations[..., school.batch.layout.slices["line_offset"]]
    lanes: np.ndarray = school.teacher.memory[..., SHIFT]
    return np.abs(lanes - offsets[..., 0])


def driven_at_random(*changes: str) -> School:
    """Return a school after three seconds."""
    school = School(settings("gap={}", *changes), lambda _: None)
    chance = np.random.default_rng(0)
    for _ in range(60):
        school.look(44)
        actions = chance.uniform(-1.0, 1.0, (16, 3)).astype(np.float32)
        school.move(actions + np.float32([0.5, 0.0, 0.0]))
    school.look(44)
    return school


@pytest.mark.slow
def test_a_warm_start_comes_near_to_its_teacher_and_is_the_same_again() -> None:
    first, said = imitate(settings())
    again, _ = imitate(settings())
    errors = [float(word.strip(",")) for word in said[-1].split()[-3:]]
    assert errors[1] < 0.2
    assert first.policy.log_std.exp().tolist() == pytest.approx([np.exp(-2.0)] * 3)
    for one, other in zip(first.policy.parameters(), again.policy.parameters(), strict=True):
        assert one.equal(other)


def test_a_run_with_a_warm_start_leaves_a_policy(tmp_path: Path) -> None:
    wanted = settings("warm_start.share=0.5", "network.last_log_std=-3.0")
    outcome = train(wanted, tmp_path)
    assert outcome.evaluation["parity"] <= 1e-5
    assert outcome.evaluation["tracks"][0]["speed"] > 1.0


def test_a_warm_start_that_is_killed_goes_on_where_it_was(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Each pass is 16 decisions of 16 karts: after the fourth, 1024 are learned from."""
    monkeypatch.setattr(callback, "SAVE_S", 0.0)
    monkeypatch.setattr(callback, "TELL_S", 0.0)
    told: list[callback.TrainingProgress] = []

    def kill(news: callback.TrainingProgress) -> None:
        told.append(news)
        if len(told) == 5:
            raise OSError

    with pytest.raises(OSError):  # noqa: PT011  # of `kill`
        train(settings(), tmp_path, tell=kill)
    assert told[-1].method == "imitation"
    assert torch.load(tmp_path / callback.LATEST, weights_only=True)["done"] == 1024


def test_a_warm_start_ends_once_its_goal_is_reached_and_is_logged(tmp_path: Path) -> None:
    wanted = settings("evaluation.times=8", "goal={speed = -9.0}")
    outcome = train(wanted, tmp_path, tensorboard=True)
    assert outcome.evaluation["goal_reached"]
    assert outcome.evaluation["learned_on"] == ["oval"]
    assert list((tmp_path / "tensorboard" / "race").glob("events.*"))
    assert outcome.evaluation["steps"] < 0.5 * (wanted.steps or 0)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (("action=report_b",), "'report_b': a teacher answers with pedals and steering"),
        (("algorithm.name=sac", "algorithm.options={}"), "only ppo with continuous actions"),
        (("warm_start.teacher=learned:none-such",), "policy 'none-such' is unknown"),
        (("warm_start.teacher=none_such",), "driver 'none_such' is unknown"),
        (("warm_start.advice=[0.5]",), "give 6 numbers to a driver on the reference line"),
        (("curriculum=[{after = 0.0}]",), "with a curriculum: a teacher shows all tracks"),
    ],
)
def test_what_cannot_be_imitated_is_refused(changes: tuple[str, ...], message: str) -> None:
    with pytest.raises(RaceError, match=message):
        imitate(settings(*changes))


def test_a_memory_forgets_the_oldest() -> None:
    memory = Memory(4, 1, 1)
    for value in range(6):
        memory.add(np.full((1, 1), value, np.float32), np.zeros((1, 1), np.float32))
    seen, _ = memory.draw(100, np.random.default_rng(0))
    assert set(seen[:, 0].tolist()) == {2.0, 3.0, 4.0, 5.0}


def test_the_critic_learns_before_the_actor_and_deviations_fall() -> None:
    wanted = settings("warm_start.share=0.5", "warm_start.critic_share=0.1", "steps=1000")
    wanted = wanted.model_copy(
        update={"network": wanted.network.model_copy(update={"last_log_std": -4.0})}
    )
    budget, world, learner = untrained(wanted)
    schedule = Schedule(wanted, budget)
    schedule.init_callback(learner)
    learns = []
    for done in (500, 599, 600, 1000):
        budget.done = done
        schedule.on_rollout_start()
        learns.append(learner.policy.action_net.weight.requires_grad)
    assert learns == [False, False, True, True]
    assert learner.policy.log_std.tolist() == pytest.approx([-4.0] * 3)
    world.close()


def test_the_critic_begins_with_what_the_actor_has_learned_to_see() -> None:
    learner, _ = imitate(settings())
    policy = learner.policy
    actor, critic = policy.mlp_extractor.policy_net, policy.mlp_extractor.value_net
    for one, other in zip(actor.parameters(), critic.parameters(), strict=True):
        assert one.equal(other)
        assert one is not other
    assert not policy.predict_values(torch.zeros(1, 44)).any()


def test_each_number_of_an_action_can_have_its_deviation_and_the_critic_its_rate() -> None:
    wanted = settings(
        "warm_start.share=0.5",
        "warm_start.critic_share=0.1",
        "warm_start.critic_learning_rate=1e-3",
        "warm_start.log_std=[-2.0, -3.0, 0.0]",
        "network.last_log_std=[-3.0, -4.0, 0.0]",
        "algorithm.learning_rate=2e-4",
        "algorithm.last_learning_rate=0.0",
        "steps=1000",
    )
    budget, world, learner = untrained(wanted)
    schedule = Schedule(wanted, budget)
    schedule.init_callback(learner)
    rates, logarithms = [], []
    for done in (599, 600, 750, 1000):
        budget.done = done
        schedule.on_rollout_start()
        rates.append(learner.lr_schedule(1.0))
        logarithms.append(learner.policy.log_std.tolist())
    assert rates == pytest.approx([1e-3, 2e-4, 1.25e-4, 0.0])
    assert logarithms[2] == pytest.approx([-2.5, -3.5, 0.0])
    assert logarithms[3] == pytest.approx([-3.0, -4.0, 0.0])
    world.close()


def test_deviations_for_another_number_of_actions_are_refused_before_anybody_learns() -> None:
    wanted = settings("warm_start.log_std=[-2.0, -3.0]")
    world = world_of(wanted, Budget.of(wanted))
    with pytest.raises(ScenarioError, match="the action has 3 numbers; give as many"):
        learner_of(wanted, world, Budget.of(wanted), None)
    world.close()


def test_inputs_are_stretched_apart_and_no_answer_changes() -> None:
    wanted = settings("warm_start.floor=1e-4")
    _, world, learner = untrained(wanted)
    ones = np.ones(3, np.float32)
    lessons = SupervisedSteps(wanted.warm_start, learner, world, ones, 0.5 * ones)
    seen = np.random.default_rng(0).normal(1.0, 0.3, (500, 44)).astype(np.float32)
    seen[:, 1] = seen[:, 0] + 0.5 * seen[:, 2]
    before, rows = lessons.answer(seen), world.normalize_obs(seen)
    for part in (seen[:100], seen):
        lessons.look_at(world.view(part))
        assert np.allclose(lessons.answer(seen), before, atol=1e-5)
        assert world.stretch is not None
        assert (world.stretch == world.stretch.astype(np.float32)).all()
    apart = world.normalize_obs(seen)
    together = [np.corrcoef(some[:, 0], some[:, 1])[0, 1] for some in (rows, apart)]
    assert together[0] > 0.5
    assert abs(together[1]) < 0.1
    world.close()


def test_below_the_middle_an_answer_too_high_counts_more_than_one_too_low() -> None:
    answers, wanted = torch.tensor([0.4, -0.4]), torch.zeros(2)
    assert loss_of("absolute", answers, wanted, torch.tensor(0.25)).tolist() == [
        pytest.approx(0.6),
        pytest.approx(0.2),
    ]
    middle = loss_of("squared", answers, wanted, torch.tensor(0.5))
    assert middle.tolist() == pytest.approx([0.16, 0.16])


def test_a_careful_learner_takes_the_lower_of_answers_that_fit_alike() -> None:
    wanted = settings("warm_start={teacher = 'raceline', loss = 'absolute', learning_rate = 1e-2}")
    _, world, learner = untrained(wanted)
    quantiles = np.array([0.25, 0.5, 0.5], np.float32)
    lessons = SupervisedSteps(wanted.warm_start, learner, world, np.ones(3, np.float32), quantiles)
    labels = np.zeros((5, 3), np.float32)
    labels[:, 0] = labels[:, 1] = -0.8, -0.4, 0.0, 0.4, 0.8
    seen = np.ones((5, 44), np.float32)
    for step in range(200):
        lessons.learn(world.view(seen), labels, step / 200)
    drive, steering, _ = lessons.answer(seen)[0]
    assert drive == pytest.approx(-0.4, abs=0.1)
    assert steering == pytest.approx(0.0, abs=0.1)
    world.close()
