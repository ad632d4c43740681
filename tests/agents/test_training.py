"""Training: a run leaves a complete folder, and its policy drives."""

from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import torch

from race_agents.policies.session import Policy
from race_agents.training import curve, folder
from race_agents.training.callback import BEST, CURVE, LATEST, TrainingProgress
from race_agents.training.checkpoint import load_checkpoint, save_checkpoint
from race_agents.training.evaluation import Examiner, basis_of
from race_agents.training.export import difference, export_policy, metadata_from
from race_agents.training.learner import CLASSES
from race_agents.training.race_marks import RaceMarks
from race_agents.training.run import TrainingResult, train, warn_of_lidar
from race_agents.training.settings_toml import read_settings
from race_agents.training.tasks import validation_courses
from race_server.errors import ScenarioError, TrackError
from support.trainings import QUICK, untrained


def test_a_run_leaves_a_complete_folder(outcome: TrainingResult) -> None:
    names = {path.name for path in outcome.folder.iterdir()}
    wanted = {"config.toml", "versions.json", "evaluation.json", "policy.onnx", "README.md"}
    assert wanted | {CURVE, "curve.png", LATEST, BEST} <= names
    assert len(curve.read(outcome.folder / CURVE)) >= 2
    assert outcome.evaluation["steps"] >= 2000
    assert [row["track"] for row in outcome.evaluation["tracks"]] == ["oval", "all"]


def test_the_file_answers_like_the_learner(outcome: TrainingResult) -> None:
    assert outcome.evaluation["compared_observations"] >= 400
    assert outcome.evaluation["parity"] <= 1e-5


def test_a_resumed_run_goes_on_counting(outcome: TrainingResult, tmp_path: Path) -> None:
    for name in ("config.toml", LATEST, BEST, CURVE, "evaluation.json"):
        (tmp_path / name).write_bytes((outcome.folder / name).read_bytes())
    again = train(folder.settings_in(tmp_path, ("steps=2800",)), tmp_path, resume=True)
    first = outcome.evaluation["steps"]
    assert 2800 <= again.evaluation["steps"] < 2800 + first
    steps = [row["steps"] for row in curve.read(tmp_path / CURVE)]
    assert steps == sorted(steps)
    assert again.evaluation["minutes"] > outcome.evaluation["minutes"]
    assert "to the bit" in (outcome.folder / "README.md").read_text()
    assert "this run was interrupted" in (tmp_path / "README.md").read_text()


def test_scores_of_another_kind_are_not_compared(outcome: TrainingResult, tmp_path: Path) -> None:
    """A return of 1000 would never be beaten by metres per second."""
    for name in ("config.toml", LATEST, BEST, CURVE):
        (tmp_path / name).write_bytes((outcome.folder / name).read_bytes())
    stored = torch.load(tmp_path / BEST, weights_only=True)
    said: list[str] = []
    for basis, is_kept in (("", True), (stored["basis"], True), ("by return", False)):
        torch.save({**stored, "score": 1000.0, "basis": basis}, tmp_path / BEST)
        train(folder.settings_in(tmp_path), tmp_path, resume=True, say=said.append)
        (tmp_path / "evaluation.json").unlink()
        score = torch.load(tmp_path / BEST, weights_only=True)["score"]
        assert (score == 1000.0) == is_kept
    assert sum("evaluated otherwise than before" in text for text in said) == 1


def test_a_score_is_of_what_it_was_made_by() -> None:
    plain = read_settings("time-trial-ppo", QUICK)
    more = ("evaluation.times=9", "evaluation.final.names=['covapsy-base']", "reward={speed = 9.0}")
    assert basis_of(read_settings("time-trial-ppo", [*QUICK, *more])) == basis_of(plain)
    for change in ("evaluation.score=return", "evaluation.seconds=4.0"):
        assert basis_of(read_settings("time-trial-ppo", [*QUICK, change])) != basis_of(plain)
    returns = ("evaluation.score=return", "reward={speed = 9.0}")
    by_other, by_own = (
        basis_of(read_settings("time-trial-ppo", [*QUICK, *returns[:count]])) for count in (1, 2)
    )
    assert by_other != by_own


def test_a_run_of_more_decisions_than_fit_into_31_bits_is_resumed(
    outcome: TrainingResult, tmp_path: Path
) -> None:
    for name in ("config.toml", LATEST, BEST, CURVE):
        (tmp_path / name).write_bytes((outcome.folder / name).read_bytes())
    stored = torch.load(tmp_path / LATEST, weights_only=True)
    torch.save({**stored, "done": 2_200_000_000}, tmp_path / LATEST)
    settings = folder.settings_in(tmp_path, ("steps=2200000400", "evaluation.seconds=1.0"))
    assert train(settings, tmp_path, resume=True).evaluation["steps"] == 2_200_000_400


def test_an_evaluation_of_fewer_decisions_is_made_again(
    outcome: TrainingResult, tmp_path: Path
) -> None:
    """The run had gone on, and was killed before it was evaluated again."""
    for name in ("config.toml", LATEST, BEST, CURVE):
        (tmp_path / name).write_bytes((outcome.folder / name).read_bytes())
    (tmp_path / "evaluation.json").write_text('{"steps": 1000}')
    assert train(folder.settings_in(tmp_path), tmp_path, resume=True).evaluation["steps"] == 2000


def test_the_policy_that_reaches_the_goal_is_the_one_that_is_written(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The first is faster and crashes; the second does not, as the goal asks."""
    marks = [
        RaceMarks("oval", speed, rate, 1.0, None, 0.0, 1)
        for speed, rate in ((3.0, 0.25), (2.9, 0.0))
    ]
    shown = iter([*marks, marks[1], marks[1]])
    monkeypatch.setattr(Examiner, "examine", lambda *_: [next(shown)])
    done = train(read_settings("time-trial-ppo", (*QUICK, "goal.crash_rate=0.0")), tmp_path)
    assert done.evaluation["goal_reached"]
    best = torch.load(tmp_path / BEST, weights_only=True)
    assert best["score"] == pytest.approx(2.9)


def test_every_rollout_is_learned_from(tmp_path: Path) -> None:
    """Of 8 karts with 50 decisions each, so 400 decisions; one begun is finished."""
    for steps, rollouts in ((100, 1), (400, 1), (401, 2), (800, 2)):
        changes = (*QUICK, f"steps={steps}", "evaluation.times=1", "evaluation.seconds=1.0")
        place = tmp_path / str(steps)
        place.mkdir()
        done = train(read_settings("time-trial-ppo", changes), place)
        assert done.evaluation["steps"] == 400 * rollouts
        latest = torch.load(place / LATEST, weights_only=True)
        assert latest["counters"]["_n_updates"] == rollouts  # of one epoch each


def test_a_run_leaves_nothing_among_temporary_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    temporary, place = tmp_path / "temporary", tmp_path / "run"
    temporary.mkdir()
    place.mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(temporary))
    changes = (*QUICK, "steps=400", "evaluation.times=1", "evaluation.seconds=1.0")
    train(read_settings("time-trial-ppo", changes), place)
    assert list(temporary.iterdir()) == []


def test_minutes_that_are_over_end_a_rollout(tmp_path: Path) -> None:
    changes = (*QUICK, "steps=none", "minutes=1e-9", "evaluation.seconds=1.0")
    done = train(read_settings("time-trial-ppo", changes), tmp_path)
    assert done.evaluation["steps"] <= 8


def test_a_run_with_less_time_than_it_has_had_is_refused_and_left_as_it_is(
    outcome: TrainingResult, tmp_path: Path
) -> None:
    for name in ("config.toml", LATEST, BEST, "evaluation.json"):
        (tmp_path / name).write_bytes((outcome.folder / name).read_bytes())
    settings, steps = folder.settings_in(tmp_path, ("steps=900",)), outcome.evaluation["steps"]
    with pytest.raises(ScenarioError, match=f"has learned for {steps} of 900 decisions"):
        train(settings, tmp_path, resume=True)
    assert (tmp_path / "config.toml").read_bytes() == (outcome.folder / "config.toml").read_bytes()
    (tmp_path / "evaluation.json").unlink()  # it was killed while it was evaluated
    said: list[str] = []
    assert train(settings, tmp_path, resume=True, say=said.append).evaluation["steps"] == steps
    assert any("only evaluated" in text for text in said)


def test_a_person_who_interrupts_hears_at_once_what_follows(tmp_path: Path) -> None:
    said: list[str] = []

    def interrupt(news: TrainingProgress) -> None:
        if news.marks is not None and "interrupted" not in " ".join(said):
            raise KeyboardInterrupt

    settings = read_settings("time-trial-ppo", [*QUICK, "steps=100000", "evaluation.times=100"])
    done = train(settings, tmp_path, tell=interrupt, say=said.append)
    assert done.stopped
    assert done.evaluation["steps"] < 100_000
    assert any(text.startswith("interrupted") for text in said)


def test_the_weight_of_the_entropy_goes_on_where_it_was(tmp_path: Path) -> None:
    changes = (*QUICK, "worlds=2", "algorithm={name = 'sac'}", "lidar.logarithms=true")
    settings, path = read_settings("time-trial-ppo", changes), tmp_path / "it.pt"
    budget, world, learner = untrained(settings)
    learner.log_ent_coef.data.fill_(-4.0)
    save_checkpoint(path, learner, world, budget)
    _, again, other = untrained(settings)
    weight = other.log_ent_coef
    load_checkpoint(path, other, again, budget)
    assert other.log_ent_coef is weight  # its optimiser's
    assert float(weight.detach()) == -4.0
    for one in (world, again):
        one.close()


def test_last_observations_are_kept_as_they_were_seen() -> None:
    changes = (*QUICK, "worlds=4", "algorithm={name = 'sac'}", "lidar.logarithms=true")
    _, world, _ = untrained(read_settings("time-trial-ppo", changes))
    world.reset()
    for _ in range(20):
        world.step(np.zeros((4, 3), np.float32))
    seen = world.get_original_obs()
    normal = world.normalize_obs(seen)
    assert world.unnormalize_obs(normal) == pytest.approx(world.view.undone(world.view(seen)), 1e-3)
    assert world.normalize_obs(world.unnormalize_obs(normal)) == pytest.approx(normal, abs=1e-3)
    world.close()


def test_sac_with_noise_that_depends_on_the_state_is_exported(tmp_path: Path) -> None:
    changes = (*QUICK, "worlds=2", "algorithm={name = 'sac', options = {use_sde = true}}")
    settings, path = read_settings("time-trial-ppo", changes), tmp_path / "it.onnx"
    _, world, learner = untrained(settings)
    export_policy(path, learner, world, metadata_from(settings, ("oval",)))
    seen = np.random.default_rng(1).uniform(0.0, 8.0, (64, 44)).astype(np.float32)
    assert difference(Policy(path), learner, world, seen) <= 1e-5
    world.close()


def test_answers_that_a_learner_takes_for_alike_are_no_difference() -> None:
    changes = (*QUICK, "worlds=2", "action=discrete", "network.first_action=[]")
    settings = read_settings("time-trial-ppo", [*changes, "algorithm={name = 'dqn'}"])
    _, world, learner = untrained(settings)
    seventh: Any = SimpleNamespace(decide=lambda seen: np.full((len(seen), 1), 7.0, np.float32))
    seen = np.ones((5, 44), np.float32)
    last = learner.q_net.q_net[-1]
    last.weight.data.zero_()
    last.bias.data.zero_()
    assert difference(seventh, learner, world, seen) == 0.0
    last.bias.data[3] = 0.5
    assert difference(seventh, learner, world, seen) == 0.5
    world.close()


def test_who_stands_until_he_is_out_was_slow_all_the_time() -> None:
    changes = (*QUICK, "evaluation.seconds=20.0", "race.rules.stopped_limit_s=3.0")
    settings = read_settings("time-trial-ppo", changes)
    examiner = Examiner(settings, validation_courses(settings), 1)
    decisions = 0

    def drives_a_second(seen: np.ndarray) -> np.ndarray:
        nonlocal decisions
        decisions += 1
        braking = np.where(seen[:, 42] > 0.15, -1.0, 0.0)  # its speed
        drive = np.full(len(seen), 0.5) if decisions < 20 else braking
        return np.stack([drive, 0.0 * drive, 0.0 * drive], axis=1).astype(np.float32)

    (marks, _) = examiner.examine(drives_a_second)
    batch = examiner.batches["oval"]
    end = batch.world.racers["distance"][:, 0].copy()
    batch.reset(1)
    metres = float((end - batch.world.racers["distance"][:, 0]).mean())
    assert marks.crash_rate == 0.0
    assert decisions < 400  # they were out before the end
    assert metres > 0.1
    assert marks.speed == pytest.approx(metres / 20.0)
    examiner.close()


def test_two_trainings_never_share_a_folder(tmp_path: Path) -> None:
    with (
        folder.occupied(tmp_path),
        pytest.raises(ScenarioError, match="another training uses it"),
        folder.occupied(tmp_path),
    ):
        pass
    with folder.occupied(tmp_path):
        assert not list(tmp_path.iterdir())


def test_a_training_that_did_not_begin_leaves_nothing_but_what_was_there(tmp_path: Path) -> None:
    settings = read_settings("time-trial-ppo")
    new, used = tmp_path / "new", tmp_path / "used"
    for place in (new, used):
        place.mkdir()
        folder.begin(place, settings)
    (used / "notes.txt").write_text("mine")
    folder.abandon(new)
    folder.abandon(used)
    assert not new.exists()
    assert (used / "notes.txt").exists()


def test_a_course_of_the_last_evaluation_is_looked_up_before_the_first_lesson(
    tmp_path: Path,
) -> None:
    settings = read_settings("time-trial-ppo", [*QUICK, "evaluation.final.names=['moon']"])
    with pytest.raises(TrackError, match="track 'moon' is unknown"):
        train(settings, tmp_path)
    assert not list(tmp_path.iterdir())


def test_a_run_says_how_to_drive_it_with_its_own_vehicle_and_courses(tmp_path: Path) -> None:
    changes = ["vehicle=kart-60", "evaluation.final={names = ['oval-reversed', 'oval']}"]
    ways = folder.ways_to_drive(tmp_path, read_settings("time-trial-ppo", changes))
    assert ways == (
        f"race trial --drivers learned:{tmp_path} --tracks oval --vehicle kart-60",
        f"race start --drivers learned:{tmp_path},follow_gap --karts 4 --track oval "
        "--vehicle kart-60",
    )


def test_a_lidar_that_no_race_shows_is_told_of_at_once() -> None:
    said: list[str] = []
    for rays in (21, 100):
        warn_of_lidar(read_settings("time-trial-ppo", [f"lidar.rays={rays}"]), said.append)
    assert said == [
        "lidar.rays = 100: no race has these, so the policy cannot drive in one; choose one of "
        "201, 101, 51, 41, 26, 21"
    ]


def test_demonstrations_are_found_from_anywhere() -> None:
    settings = read_settings("time-trial-ppo", ["warm_start.demonstrations=laps.npz"])
    assert settings.warm_start.demonstrations == str(Path.cwd() / "laps.npz")


def test_a_damaged_checkpoint_is_refused(outcome: TrainingResult, tmp_path: Path) -> None:
    (tmp_path / BEST).write_bytes(b"\x80\x04nonsense")
    with pytest.raises(ScenarioError, match=r"best.pt: damaged"):
        train(folder.settings_in(outcome.folder), tmp_path, resume=True)


@pytest.mark.parametrize(
    ("algorithm", "action"), [("sac", "continuous"), ("td3", "report_b"), ("dqn", "discrete")]
)
def test_every_algorithm_makes_a_file_that_answers_like_it(
    algorithm: str, action: str, tmp_path: Path
) -> None:
    changes = [
        *QUICK,
        "steps=400",
        f"algorithm={{name = '{algorithm}', options = {{learning_starts = 100}}}}",
        f"action={action}",
        "evaluation.times=1",
    ]
    done = train(read_settings("time-trial-ppo", changes), tmp_path)
    assert done.evaluation["parity"] <= 1e-5
    assert algorithm in CLASSES
