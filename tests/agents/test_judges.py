"""Rewards of judges that learn: curiosity explores, adversarial imitation drives like an expert."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stable_baselines3.common.vec_env import VecNormalize

from race_agents.training.budget import Budget
from race_agents.training.checkpoint import (
    begin_with,
    companions_in,
    load_checkpoint,
    save_checkpoint,
)
from race_agents.training.curiosity import Curious
from race_agents.training.demonstrations import write_demonstrations
from race_agents.training.demonstrator import demonstrate
from race_agents.training.evaluation import Examiner, Marks
from race_agents.training.gail import Discriminator
from race_agents.training.learner import learner_of, world_of
from race_agents.training.reward_wrapper import RewardWrapper, numbers_of, width_of
from race_agents.training.settings import Curiosity, Settings
from race_agents.training.settings_toml import read_settings
from race_agents.training.tasks import training_task, validation_courses
from race_server.envs.sb3 import KartVecEnv
from race_server.envs.spaces import action_space
from support.trainings import untrained

QUICK = (
    "minutes=none",
    "steps=16000",
    "worlds=32",
    "tracks={names = ['oval']}",
    "lidar.rays=21",
    "network.layers=[32]",
    "evaluation={tracks = {names = ['oval']}, seeds = 4, seconds = 10.0}",
    "algorithm.learning_rate=1e-3",
    "algorithm.options={n_steps = 32, batch_size = 256, n_epochs = 8}",
)


def settings(*changes: str) -> Settings:
    return read_settings("time-trial-ppo", [*QUICK, *changes])


def learned(wanted: Settings) -> tuple[Marks, VecNormalize]:
    """Return how a policy drives after its steps, and its world."""
    _, world, learner = untrained(wanted)
    learner.learn(wanted.steps)
    examiner = Examiner(wanted, validation_courses(wanted), wanted.evaluation.first_seed)
    marks = examiner.examine(
        lambda seen: learner.predict(world.normalize_obs(seen), deterministic=True)[0]
    )
    examiner.close()
    world.close()
    return marks[0], world


@pytest.fixture(scope="module")
def laps(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("laps") / "laps.npz"
    write_demonstrations(path, demonstrate("raceline", ["oval"], "tt02", 2, 1, 0.1)[0])
    return path


# Curiosity


@pytest.mark.slow
def test_what_is_known_is_worth_less_than_what_is_new() -> None:
    chance = np.random.default_rng(0)
    judge = Curious(Curiosity(bonus=1.0, learning_rate=1e-2), 2, 1, seed=0)

    def transitions(centre: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        seen = chance.normal(centre, 0.5, (256, 2)).astype(np.float32)
        actions = chance.uniform(-1.0, 1.0, (256, 1)).astype(np.float32)
        return seen, actions, seen + actions

    for _ in range(100):
        judge.learn(*transitions(0.0))
    known, new = (judge.worth(*transitions(centre)).mean() for centre in (0.0, 3.0))
    assert new > 2.0 * known


@pytest.mark.slow
def test_what_becomes_known_is_worth_nothing_where_a_surprise_counts_as_it_is() -> None:
    chance = np.random.default_rng(0)
    worth = {}
    for most in (None, 1.0):
        wanted = Curiosity(bonus=0.5, learning_rate=1e-2, most=most)
        judge = Curious(wanted, 2, 1, seed=0)
        means = []
        for _ in range(100):
            seen = chance.normal(0.0, 0.5, (256, 2)).astype(np.float32)
            actions = chance.uniform(-1.0, 1.0, (256, 1)).astype(np.float32)
            means.append(judge.worth(seen, actions, seen + actions))
            judge.learn(seen, actions, seen + actions)
        worth[most] = means
    assert np.max(worth[1.0]) <= 1.0
    assert np.mean(worth[1.0][-10:]) < 0.01
    # Beside the mean of all surprises so far it falls more slowly: those of the start count on.
    assert np.mean(worth[None][-10:]) > 2.0 * np.mean(worth[1.0][-10:])


@pytest.mark.slow
def test_curiosity_drives_further_where_only_a_lap_is_rewarded() -> None:
    # One training may be lucky or not, differently on each processor: three of each are compared.
    def speed(*changes: str) -> float:
        wanted = ("reward={lap = 1.0}", "steps=40000", "algorithm.name=ppo-sb3", *changes)
        return sum(learned(settings(*wanted, f"seed={seed}"))[0].speed for seed in (1, 2, 3)) / 3.0

    assert speed("curiosity.bonus=0.5") > 1.5 * speed()


# Adversarial imitation


def test_a_discriminator_tells_an_expert_from_others(laps: Path) -> None:
    judge = Discriminator(settings(f"gail.demonstrations={laps}", "gail.learning_rate=1e-2"))
    chance = np.random.default_rng(0)
    seen = judge._seen[:200]
    others = chance.uniform(-1.0, 1.0, (200, 3)).astype(np.float32)
    for _ in range(20):
        judge.learn(seen, others, seen)
    assert judge.worth(seen, judge._actions[:200], seen).mean() > 2.0 * (
        judge.worth(seen, others, seen).mean()
    )


@pytest.mark.parametrize(
    ("action", "has_items", "judged"),
    [
        ("continuous", "false", [0.0, 0.0, 0.0]),
        ("continuous", "true", [0.0, 0.0, 1.0]),
        ("control", "false", [0.0, 0.0, 0.0]),
        ("control", "true", [0.0, 0.0, 1.0]),
    ],
)
def test_a_judge_sees_whether_a_button_is_pressed_and_not_its_number(
    laps: Path, action: str, has_items: str, judged: list[float]
) -> None:
    wanted = (f"gail.demonstrations={laps}", f"action={action}", f"race.rules.items={has_items}")
    judge = Discriminator(settings(*wanted))
    # As the world reads them: an item above a half, or the whole part of the sum of buttons.
    last = [0.0, 0.4, 0.6] if action == "continuous" else [0.0, 0.9, 1.9]
    shown = judge._actions[:3].copy()
    shown[:, -1] = judged
    own = shown.copy()
    own[:, -1] = last
    seen = judge._seen[:3]
    assert np.array_equal(judge.worth(seen, own, seen), judge.worth(seen, shown, seen))


@pytest.mark.slow
def test_a_policy_comes_nearer_to_an_expert_without_the_race_s_reward(laps: Path) -> None:
    judged = (f"gail.demonstrations={laps}", "gail.learning_rate=1e-3", "steps=50000")

    def speed(*changes: str) -> float:
        return sum(learned(settings(*changes, f"seed={seed}"))[0].speed for seed in (1, 2, 3)) / 3.0

    assert speed(*judged) > 2.0 * max(speed("steps=1"), 0.1)


# Both


def test_judges_go_on_where_a_checkpoint_left_them(laps: Path, tmp_path: Path) -> None:
    wanted = settings(f"gail.demonstrations={laps}", "curiosity.bonus=0.1", "steps=2048")
    path, budget = tmp_path / "it.pt", Budget.of(wanted)
    world = world_of(wanted, budget)
    learner = learner_of(wanted, world, budget, None)
    learner.learn(wanted.steps)
    save_checkpoint(path, learner, world, budget)
    again = world_of(wanted, budget)
    other = learner_of(wanted, again, budget, None)
    load_checkpoint(path, other, again, budget)
    judges, copies = companions_in(world), companions_in(again)
    assert set(judges) == set(copies) == {"gail", "curiosity"}
    chance = np.random.default_rng(0)
    seen = chance.uniform(0.0, 8.0, (64, 44)).astype(np.float32)
    actions = chance.uniform(-1.0, 1.0, (64, 3)).astype(np.float32)
    transitions = (seen, actions, seen + 0.1)
    for name, judge in judges.items():
        copy: Any = copies[name]
        moments = judge._optimiser.state_dict()["state"]  # type: ignore[attr-defined]
        assert len(moments) > 0
        for number, values in copy._optimiser.state_dict()["state"].items():
            assert all(moments[number][key].equal(value) for key, value in values.items())
        expected = judge.worth(*transitions)  # type: ignore[attr-defined]
        assert np.array_equal(copy.worth(*transitions), expected)
    for one in (world, again):
        one.close()


def test_a_judge_that_a_checkpoint_does_not_know_begins_anew(tmp_path: Path) -> None:
    plain, curious = settings(), settings("curiosity.bonus=0.1")
    path, budget = tmp_path / "it.pt", Budget.of(plain)
    world = world_of(plain, budget)
    save_checkpoint(path, learner_of(plain, world, budget, None), world, budget, score=3.0)
    wider = world_of(curious, budget)
    assert load_checkpoint(path, learner_of(curious, wider, budget, None), wider, budget) == 3.0


def test_a_run_that_begins_with_the_networks_of_another_keeps_its_own_judges(
    laps: Path, tmp_path: Path
) -> None:
    words = (f"gail.demonstrations={laps}", "curiosity.bonus=0.1")
    path, old = tmp_path / "it.pt", settings(*words)
    budget, world, learner = untrained(old)
    save_checkpoint(path, learner, world, budget)
    _, fresh, other = untrained(settings(*words, "seed=2"))
    judges: Any = companions_in(fresh)
    networks = (judges["gail"]._network, judges["curiosity"]._networks)
    before = [weights.clone() for network in networks for weights in network.parameters()]
    begin_with(path, other, fresh)
    after = [weights for network in networks for weights in network.parameters()]
    assert all(one.equal(kept) for one, kept in zip(after, before, strict=True))
    for one in (world, fresh):
        one.close()


def test_judges_are_the_same_again_with_the_same_seed() -> None:
    wanted = settings("steps=800", "curiosity.bonus=0.1")
    (first, _), (again, _) = learned(wanted), learned(wanted)
    assert first == again


def test_a_judge_sees_where_an_episode_ended_and_not_where_the_next_began() -> None:
    class Notes:
        def __init__(self) -> None:
            self.jumps: list[float] = []

        def worth(self, seen: np.ndarray, actions: np.ndarray, after: np.ndarray) -> np.ndarray:
            self.jumps.append(float(np.abs(after - seen)[:, -2].max()))
            return np.full(len(seen), 2.0, np.float32)

        def learn(self, seen: np.ndarray, actions: np.ndarray, after: np.ndarray) -> None:
            self.jumps.append(0.0)

    karts = KartVecEnv(training_task(settings("episode.steps=20")), worlds=4)
    world = RewardWrapper(karts, Notes(), own_share=0.0, decisions=8)
    world.reset()
    for _ in range(40):
        _, rewards, _, _ = world.step(np.tile(np.float32([1.0, 0.0, 0.0]), (4, 1)))
        assert rewards.tolist() == [2.0] * 4
    notes = world.judge.jumps  # type: ignore[attr-defined]
    assert len(notes) == 45
    # A kart that starts again loses its speed at once; no kart can brake like that.
    assert max(notes) < 1.0
    world.close()


def test_discrete_actions_become_numbers() -> None:
    space = action_space("discrete")
    assert width_of(space) == 15
    assert numbers_of(np.array([3, 0]), space).argmax(axis=1).tolist() == [3, 0]
