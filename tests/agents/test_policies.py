"""Policies by name: verified, and listed with their origin."""

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from race_agents.policies.registry import policy_path
from race_agents.policies.session import Policy
from race_agents.policies.verification import observations_of, times_of
from race_agents.training.onnx_graph import policy_of
from race_agents.training.run import TrainingResult
from race_server.cli.main import app
from race_server.core.driver import driver_named
from race_server.envs.batch import Batch
from race_server.envs.buffers import STAY
from race_server.envs.presets import task_on
from race_server.envs.task import Task
from race_server.errors import DriverError
from race_server.scenario.race import Rules, Scenario
from race_server.scenario.track.load import load_course
from support.trainings import QUICK, Train, write_lapping_policy


@pytest.fixture(scope="module")
def outcome(trained: Train) -> TrainingResult:
    """A run of two thousand decisions."""
    return trained("time-trial-ppo", QUICK)


@pytest.fixture(scope="module")
def lapping(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("policies") / "lapping.onnx"
    write_lapping_policy(path)
    return path


def checked(*words: str) -> dict[str, object]:
    done = CliRunner().invoke(app, ["policy", "check", *words, "--observations", "600", "--json"])
    assert done.exit_code == 0, done.output
    return dict(json.loads(done.stdout))


def test_observations_are_those_of_driving_on_unseen_tracks(lapping: Path) -> None:
    policy = Policy(lapping)
    seen = observations_of(policy, 700)
    assert seen.shape == (700, 22)
    assert seen[:, 21].max() > 1.0  # it drives
    assert len(set(seen[:16, 10].tolist())) == 16  # from other places
    times = times_of(policy, seen)
    assert 0.0 < times.median <= times.p99


def test_a_person_reads_from_which_set_of_tracks_the_observations_are(lapping: Path) -> None:
    done = CliRunner().invoke(app, ["policy", "check", str(lapping), "--observations", "16"])
    assert done.exit_code == 0, done.output
    assert "16 of the tracks of the set unseen" in done.output


def test_a_run_is_compared_with_its_learner(outcome: TrainingResult) -> None:
    found = checked(str(outcome.folder))
    difference = found["difference"]
    assert isinstance(difference, float)
    assert difference <= 1e-5
    assert found["ok"]
    assert found["observations"] == 600
    assert found["bytes"] == (outcome.folder / "policy.onnx").stat().st_size


def test_a_file_that_answers_otherwise_than_its_learner_fails(
    outcome: TrainingResult, lapping: Path, tmp_path: Path
) -> None:
    for name in ("config.toml", "best.pt", "latest.pt"):
        shutil.copy(outcome.folder / name, tmp_path / name)
    # Another network with the same shapes: that of before its last lessons would do as well.
    import onnx
    from onnx import numpy_helper

    model = onnx.load(outcome.folder / "policy.onnx")
    bias = next(one for one in model.graph.initializer if one.dims == [3])
    bias.CopyFrom(numpy_helper.from_array(numpy_helper.to_array(bias) + 0.01, bias.name))
    exported = policy_of(model, Policy(outcome.folder / "policy.onnx").metadata)
    (tmp_path / "policy.onnx").write_bytes(exported)
    done = CliRunner().invoke(app, ["policy", "check", str(tmp_path), "--observations", "100"])
    assert done.exit_code == 1
    assert "export it again" in done.output


def test_a_file_with_one_byte_changed_in_its_weights_is_refused(
    outcome: TrainingResult, tmp_path: Path
) -> None:
    data = bytearray((outcome.folder / "policy.onnx").read_bytes())
    data[len(data) // 2] ^= 1
    path = tmp_path / "policy.onnx"
    path.write_bytes(data)
    with pytest.raises(DriverError, match="not as it was exported"):
        Policy(path)


def test_a_file_alone_is_timed_and_says_so(lapping: Path) -> None:
    found = checked(str(lapping))
    assert found["difference"] is None
    assert "is no folder of a run" in str(found["remark"])
    done = CliRunner().invoke(app, ["policy", "check", str(lapping), "--observations", "100"])
    assert "lidar (21), speed" in done.output


WITHOUT = """
import sys
for name in ("torch", "stable_baselines3", "onnx"):
    sys.modules[name] = None
from race_server.cli.main import app
app()
"""


def test_a_check_without_pytorch_says_what_is_missing(outcome: TrainingResult) -> None:
    words = ["policy", "check", str(outcome.folder), "--observations", "50", "--json"]
    command = [sys.executable, "-c", WITHOUT, *words]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    found = json.loads(done.stdout)
    assert found["difference"] is None
    assert "pip install race-server[train]" in found["remark"]
    assert found["decision_us"]["median"] > 0.0


def test_a_list_tells_of_runs_and_of_what_is_damaged(
    outcome: TrainingResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    runs = tmp_path / "race-server" / "runs"
    shutil.copytree(outcome.folder, runs / "mine")
    (runs / "broken").mkdir()
    (runs / "broken" / "policy.onnx").write_bytes(b"nonsense")
    done = CliRunner().invoke(app, ["policy", "list", "--json"])
    rows = {row["name"]: row for row in json.loads(done.stdout) if row["is_run"]}
    assert set(rows) == {"mine", "broken"}
    mine = rows["mine"]
    assert (mine["preset"], mine["vehicle"], mine["tracks"]) == (
        "Time trial by PPO alone",
        "tt02",
        ["oval"],
    )
    assert mine["evaluation"]["speed"] == outcome.evaluation["tracks"][-1]["speed"]
    assert "damaged" in rows["broken"]["remark"]
    told = CliRunner().invoke(app, ["policy", "list"]).output
    assert "mine" in told


# The bundled policy that knows the course


@pytest.fixture(scope="module")
def full() -> Policy:
    return Policy(policy_path("full"))


def test_the_policy_that_knows_the_course_is_small_and_needs_no_lidar(full: Policy) -> None:
    assert policy_path("full").stat().st_size < 450_000
    metadata = full.metadata
    assert (metadata.action, metadata.base, metadata.lidar_rays) == ("continuous", "", 0)
    assert {"line_speed_ahead", "karts_along", "boxes_x", "hazards_x", "item_use"} <= set(
        metadata.parts
    )
    assert driver_named("learned:full").preset == "rivals"
    assert not {"covapsy-test-2023", "covapsy-base"} & set(metadata.tracks)


def test_the_policy_that_knows_the_course_comes_before_its_teacher(full: Policy) -> None:
    rules = Rules(laps=2, countdown_s=0.2)
    opponents = ("raceline", "idm", "follow_gap", "pure_pursuit")
    task = driven_on("covapsy-base", full, karts=5, rules=rules)
    task = task.with_options(opponents=opponents, random_grid=True)
    batch = drive(full, task, worlds=24, decisions=900)
    places = batch.world.racers["rank"].mean(axis=0)
    assert places[0] < places[1] - 0.4


def test_the_policy_that_knows_the_course_laps_alone_off_the_walls(full: Policy) -> None:
    rules = Rules(laps=3, countdown_s=0.2, items=False)
    batch = drive(full, driven_on("covapsy-base", full, karts=1, rules=rules), 1, 700)
    racer = batch.world.racers[0, 0]
    assert (int(racer["laps"]), int(racer["wall_contacts"])) == (3, 0)
    assert racer["best_lap_us"] / 1e6 < 10.2


def driven_on(track: str, policy: Policy, *, karts: int, rules: Rules) -> Task:
    scenario = Scenario(load_course(track), karts=karts, rules=rules)
    return task_on((scenario,), learners=1, observation=policy.metadata.parts, action="continuous")


def drive(policy: Policy, task: Task, worlds: int, decisions: int) -> Batch:
    batch = Batch(task, worlds=worlds, seed=7, after=STAY)
    for _ in range(decisions):
        batch.step(policy.decide(batch.observations[:, 0]))
    return batch
