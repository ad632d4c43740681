"""Training: a run leaves a complete folder, and its policy drives."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import onnx
import pytest

from race_agents.drivers.learned import Learned
from race_agents.policies.metadata import KEY
from race_agents.policies.registry import SHIPPED
from race_agents.policies.session import Policy
from race_agents.training import curve, folder
from race_agents.training.callback import BEST, CURVE, LATEST
from race_agents.training.checkpoint import load_checkpoint, save_checkpoint
from race_agents.training.evaluation import Examiner
from race_agents.training.export import difference, export_policy, metadata_from
from race_agents.training.learner import CLASSES
from race_agents.training.run import TrainingResult, train, warn_of_lidar
from race_agents.training.settings_toml import read_settings
from race_agents.training.tasks import training_task
from race_server.competition.time_trial.run import numbers_of
from race_server.core.driver import Briefing, driver_named
from race_server.core.observation import Observation
from race_server.core.vehicles import KART_60, TT02, Vehicle
from race_server.envs.batch import Batch
from race_server.envs.presets import LEARNING_RULES, task_on
from race_server.envs.reality_gap import RealityGap
from race_server.errors import DriverError, ScenarioError, TrackError
from support.trainings import QUICK, Train, side_by_side, untrained


@pytest.fixture(scope="module")
def outcome(trained: Train) -> TrainingResult:
    """A run of two thousand decisions."""
    return trained("time-trial-ppo", QUICK)


@pytest.fixture
def policy_file(outcome: TrainingResult) -> Path:
    return outcome.folder / "policy.onnx"


GEAR = np.array([np.radians(200.0), 8.0, 0.05])


def briefing(vehicle: Vehicle = TT02, decision_s: float = 0.05) -> Briefing:
    return Briefing(0, vehicle, 3, "lidar", decision_s, lidar_field=np.radians(200.0))


# A run


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
    examiner = Examiner(settings, settings.evaluation.tracks, 1)
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
        "lidar.rays = 100: no race shows these, so the policy will drive in none; choose one of "
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


# The driver


def test_the_policy_that_comes_along_is_small_and_sees_what_a_real_car_senses() -> None:
    path = SHIPPED / "time-trial.onnx"
    assert path.stat().st_size < 1_000_000
    metadata = Policy(path).metadata
    assert metadata.parts == ("lidar", "lidar_before", "speed", "steering")
    assert metadata.vehicle == "tt02"


def test_the_driver_is_found_by_the_path_of_its_policy(policy_file: Path) -> None:
    driver = driver_named(f"learned:{policy_file}")
    assert driver.preset == "lidar"


def test_a_driver_does_what_the_policy_did_in_training(policy_file: Path) -> None:
    policy, driver = Policy(policy_file), Learned(str(policy_file))
    task = replace(training_task(read_settings("time-trial-ppo", QUICK)), gap=RealityGap())
    trained = Batch(task, seed=3)
    wide = task_on(task.scenarios, observation="lidar", action="control", random_start=True)
    raced = Batch(wide, seed=3)
    driver.reset(briefing())
    places = list(side_by_side(trained, raced, policy, driver, 60))
    assert len(places) > 5
    for there, here in places:
        assert here == pytest.approx(there, abs=1e-6)


def test_a_policy_drives_many_karts_of_a_batch_as_it_drives_one(policy_file: Path) -> None:
    name = f"learned:{policy_file}"
    scenario = replace(
        training_task(read_settings("time-trial-ppo", QUICK)).scenarios[0],
        karts=3,
        rules=LEARNING_RULES,
    )
    task = task_on((scenario,), learners=1, opponents=(name,), action="control")
    batch, driver = Batch(task, worlds=2, seed=5), driver_named(name)
    layout, view = batch.opponents[0].layout, batch.buffers.views[1, 2]
    driver.reset(briefing())
    for step in range(30):
        seen = Observation(step, layout, view[: layout.size].astype(np.float32))
        own = numbers_of(driver.act(seen))
        batch.step(np.zeros((2, 1, 4)))
        assert batch.buffers.controls[1, 2] == pytest.approx(own, abs=1e-6)
    assert batch.world.bodies[1, 2].speed > 0.1


def test_a_policy_takes_its_rays_out_of_a_finer_lidar(policy_file: Path) -> None:
    from race_agents.drivers.learned import places_in
    from race_server.core.observation import layout_of

    metadata = Policy(policy_file).metadata
    places = places_in(layout_of("lidar", 201), metadata, GEAR, "it")
    assert places[:3].tolist() == [0, 10, 20]
    assert len(places) == metadata.size
    with pytest.raises(DriverError, match="learned with 21 numbers of 'lidar', the race shows 200"):
        places_in(layout_of("lidar", 200), metadata, GEAR, "it")


def test_a_driver_refuses_another_vehicle_and_another_pace(policy_file: Path) -> None:
    driver = Learned(str(policy_file))
    with pytest.raises(DriverError, match="learned to drive 'tt02', not 'kart-60'"):
        driver.reset(briefing(KART_60))
    with pytest.raises(DriverError, match=r"every 0.05 s, not every 0.1 s"):
        driver.reset(briefing(decision_s=0.1))


def test_damaged_and_foreign_files_are_refused_in_one_sentence(
    policy_file: Path, tmp_path: Path
) -> None:
    bad = tmp_path / "bad.onnx"
    bad.write_bytes(policy_file.read_bytes()[:500])
    with pytest.raises(DriverError, match="damaged or no ONNX file"):
        Learned(str(bad))
    model = onnx.load(policy_file)
    words = json.loads(model.metadata_props[0].value)
    for change, message in (
        ({"version": 99}, "version 99, this program drives version 1"),
        ({"parts": ["sonar"]}, "does not know"),
        ({"action": "telepathy"}, "answers with actions 'telepathy'"),
        ({"sizes": [1, 1, 1, 1]}, "takes 44 numbers and gives 3; its metadata speak of 4"),
        ({"vehicle": 3}, "vehicle = 3"),
        ({"parts": [["speed"]]}, "parts = .* is not valid"),
        ({"tracks": [3]}, "tracks = .* is not valid"),
        ({"decision_s": float("nan")}, "decision_s = nan in its metadata"),
        ({"lidar_reach": 10**400}, "lidar_reach = inf in its metadata"),
        ({"decision_s": 0}, "decides every 0 s"),
        ({"action": "residual", "base": f"learned:{bad}"}, "takes no advice"),
    ):
        onnx.helper.set_model_props(model, {KEY: json.dumps({**words, **change})})
        onnx.save(model, bad)
        with pytest.raises(DriverError, match=message):
            Learned(str(bad))
    onnx.helper.set_model_props(model, {"author": "somebody"})
    onnx.save(model, bad)
    with pytest.raises(DriverError, match="is no policy of this program"):
        Learned(str(bad))


@pytest.mark.parametrize(
    ("operator", "inputs", "message"),
    [
        ("Div", ["nothing", "nothing"], "not all finite"),  # 0 / 0
        ("Concat", ["some", "some"], r"\(2, 3\) numbers"),
        ("Reshape", ["some", "shape"], "cannot answer"),
    ],
)
def test_a_network_that_answers_with_no_numbers_drives_nobody(
    operator: str, inputs: list[str], message: str, tmp_path: Path
) -> None:
    shipped, bad = onnx.load(SHIPPED / "time-trial.onnx"), tmp_path / "bad.onnx"
    attributes = {"axis": 0} if operator == "Concat" else {}
    nodes = [
        onnx.helper.make_node("Gather", ["observation", "columns"], ["some"], axis=1),
        onnx.helper.make_node("Sub", ["some", "some"], ["nothing"]),
        onnx.helper.make_node(operator, inputs, ["action"], **attributes),
    ]
    numbers = {"columns": np.arange(3), "shape": np.array([7, 3])}
    constants = [onnx.numpy_helper.from_array(value, name) for name, value in numbers.items()]
    body = shipped.graph
    graph = onnx.helper.make_graph(nodes, "foreign", body.input, body.output, constants)
    model = onnx.helper.make_model(
        graph, ir_version=shipped.ir_version, opset_imports=shipped.opset_import
    )
    model.metadata_props.extend(shipped.metadata_props)
    onnx.save(model, bad)
    policy = Policy(bad)
    with pytest.raises(DriverError, match=message):
        policy.decide(np.ones((1, policy.metadata.size), np.float32))


def test_an_unknown_policy_is_named_with_the_known_ones() -> None:
    with pytest.raises(DriverError, match="policy 'none-such' is unknown; known are"):
        driver_named("learned:none-such")


def test_a_driver_needs_neither_pytorch_nor_a_compiler(policy_file: Path) -> None:
    code = (
        "import sys; from race_server.core.driver import driver_named; "
        f"driver_named('learned:{policy_file}'); "
        "print({'torch', 'numba', 'onnx', 'pydantic_core'} & set(sys.modules))"
    )
    command = [sys.executable, "-c", code]
    environment = {"RACE_SERVER_INTERPRET": "1", "PATH": "", "HOME": str(policy_file.parent)}
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=environment)
    assert done.stdout.strip() == "set()"


@pytest.mark.net
def test_laps_of_a_policy_are_recorded(policy_file: Path, tmp_path: Path) -> None:
    from race_agents.training.record_laps import record_laps
    from race_server.storage.recording.reader import read_recording

    made = record_laps(tmp_path, policy_file.absolute(), "oval", "tt02", seed=1)
    assert made is not None
    assert [path.name for path in tmp_path.iterdir()] == ["laps.mcap"]
    assert read_recording(made).is_complete
