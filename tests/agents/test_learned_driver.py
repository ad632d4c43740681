"""The driver of a learned policy: what it answers, refuses and needs."""

import json
import subprocess
import sys
from dataclasses import replace
from itertools import product
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import onnx
import pytest

from race_agents.drivers.learned import Learned
from race_agents.planning.line_view import LAYOUT
from race_agents.planning.traffic import NOWHERE
from race_agents.policies.metadata import KEY
from race_agents.policies.registry import SHIPPED
from race_agents.policies.session import Policy
from race_agents.training.policy_pair import join_by_chart
from race_agents.training.settings_toml import read_settings
from race_agents.training.tasks import training_task
from race_server.competition.time_trial.run import numbers_of
from race_server.core.driver import driver_named
from race_server.core.observation import AHEAD, Observation, layout_of
from race_server.core.vehicle_presets import KART_13, KART_60
from race_server.envs.batch import Batch
from race_server.envs.presets import LEARNING_RULES, task_on
from race_server.envs.reality_gap import RealityGap
from race_server.errors import DriverError
from race_server.scenario.race import Scenario
from support.briefings import briefing
from support.courses import SMALL_RING
from support.trainings import QUICK, side_by_side, write_lapping_policy, write_untrained

GEAR = np.array([np.radians(200.0), 8.0, 0.05])
BRIEFING = briefing("lidar", lidar_field=np.radians(200.0))


def test_the_policy_that_comes_along_is_small_and_sees_what_a_real_car_senses() -> None:
    path = SHIPPED / "time-trial.onnx"
    assert path.stat().st_size < 1_000_000
    metadata = Policy(path).metadata
    assert metadata.parts[:5] == ("lidar", "lidar_before", "speed", "yaw_rate", "steering")
    assert metadata.charts
    assert Learned("time-trial").preset == "lidar"
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
    driver.reset(BRIEFING)
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
    driver.reset(BRIEFING)
    for step in range(30):
        seen = Observation(step, layout, view[: layout.size].astype(np.float32))
        own = numbers_of(driver.act(seen))
        batch.step(np.zeros((2, 1, 4)))
        assert batch.buffers.controls[1, 2] == pytest.approx(own, abs=1e-6)
    assert batch.world.bodies[1, 2].speed > 0.1


@pytest.mark.parametrize(
    ("share", "least", "most"), [(0.0, 2.8, 3.2), (10.0, 2.8, 3.2), (0.2, 0.2, 1.5)]
)
def test_a_limit_by_the_scan_brakes_a_policy_that_is_faster_than_it_can_see(
    share: float, least: float, most: float, tmp_path: Path
) -> None:
    path = tmp_path / "three-metres-a-second.onnx"
    write_lapping_policy(path)
    driver = Learned(str(path))
    driver.policy.metadata = replace(driver.policy.metadata, scan_limit=share)
    scenario = Scenario(SMALL_RING, karts=1, rules=LEARNING_RULES)
    batch = Batch(task_on((scenario,), observation="lidar", action="control"), seed=1)
    driver.reset(BRIEFING)
    for step in range(100):
        seen = Observation(3 * step, batch.layout, batch.observations[0, 0].copy())
        batch.step(numbers_of(driver.act(seen)))
    assert least < batch.world.bodies[0, 0].speed < most


def test_a_policy_that_charts_drives_by_the_scan_until_it_has_a_chart(
    policy_file: Path, tmp_path: Path
) -> None:
    line, both = tmp_path / "line.onnx", tmp_path / "both.onnx"
    sees = "observation=['speed', 'line_offset', 'line_speed_ahead']"
    write_untrained(line, "time-trial", *QUICK, sees)
    join_by_chart(both, policy_file, line)
    driver, by_scan, on_line = (Learned(str(path)) for path in (both, policy_file, line))
    assert (driver.preset, on_line.preset) == ("lidar", "line")
    for one in (driver, by_scan, on_line):
        one.reset(BRIEFING)
    layout, chance = layout_of("lidar", 201), np.random.default_rng(1)
    moving = {"lights": 0.0, "finished": 0.0, "rescue_offered": 0.0}
    scan, shown = (
        Observation(0, one, chance.uniform(0.5, 1.0, one.size).astype(np.float32))
        for one in (layout, LAYOUT)
    )
    for seen, (part, value) in product((scan, shown), moving.items()):
        seen[part][:] = value
    charts = [None, shown, None, shown]
    charting: Any = SimpleNamespace(look=lambda _: charts.pop(0), meets_others=False)
    driver._charting = charting
    answers = [driver.act(replace(scan, tick=3 * step)) for step in range(3)]
    assert answers == [by_scan.act(scan), on_line.act(shown), by_scan.act(replace(scan, tick=6))]
    charting.meets_others = True
    assert driver.act(replace(scan, tick=9)) == by_scan.act(replace(scan, tick=9))


def test_a_policy_takes_its_rays_out_of_a_finer_lidar(policy_file: Path) -> None:
    from race_agents.policies.places import places_in

    metadata = Policy(policy_file).metadata
    places = places_in(layout_of("lidar", 201), metadata, GEAR, "it")
    assert places[:3].tolist() == [0, 10, 20]
    assert len(places) == metadata.size
    with pytest.raises(DriverError, match="learned with 21 numbers of 'lidar', the race shows 200"):
        places_in(layout_of("lidar", 200), metadata, GEAR, "it")


def test_a_driver_refuses_another_vehicle_and_another_pace(policy_file: Path) -> None:
    driver = Learned(str(policy_file))
    with pytest.raises(DriverError, match="learned to drive tt02, not kart-60"):
        driver.reset(replace(BRIEFING, vehicle=KART_60))
    with pytest.raises(DriverError, match=r"every 0.05 s, not every 0.1 s"):
        driver.reset(replace(BRIEFING, decision_s=0.1))


def test_a_policy_of_several_vehicles_drives_each_of_them(policy_file: Path) -> None:
    driver = Learned(str(policy_file))
    driver.policy.metadata = replace(driver.policy.metadata, more_vehicles=("kart-60",))
    driver.reset(replace(BRIEFING, vehicle=KART_60))
    with pytest.raises(DriverError, match="learned to drive tt02 and kart-60, not kart-13"):
        driver.reset(replace(BRIEFING, vehicle=KART_13))


def test_damaged_and_foreign_files_are_refused_in_one_sentence(
    policy_file: Path, tmp_path: Path
) -> None:
    bad = tmp_path / "bad.onnx"
    bad.write_bytes(policy_file.read_bytes()[:500])
    with pytest.raises(DriverError, match="damaged or no ONNX file of a policy: it is cut short"):
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
        ({"decision_s": 1e-9}, "decides every 1e-09 s"),
        ({"lidar_rays": 10**9}, "1000000000 rays, at most 2048"),
        ({"scan_limit": -1.0}, "scan_limit = -1: it is for policies that race by a lidar"),
        ({"scan_limit": 1.2, "base": "idm", "action": "residual"}, "scan_limit = 1.2: it is for"),
        ({"evades": True}, "evades = true: it is for policies that park"),
        ({"charts": True}, "charts = true: it is for policies that race by a lidar and a line"),
        ({"evades": 1}, "evades = 1 in its metadata is not valid"),
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


def foreign_model(nodes: list[Any], numbers: dict[str, Any]) -> Any:
    """A network of three columns, with the words of a bundled policy of three actions."""
    shipped = onnx.load(SHIPPED / "time-trial.onnx")
    constants = [onnx.numpy_helper.from_array(value, name) for name, value in numbers.items()]
    body = shipped.graph
    graph = onnx.helper.make_graph(nodes, "foreign", body.input, body.output, constants)
    model = onnx.helper.make_model(
        graph, ir_version=shipped.ir_version, opset_imports=shipped.opset_import
    )
    model.metadata_props.extend(words for words in shipped.metadata_props if words.key == KEY)
    return model


@pytest.mark.parametrize(
    ("first", "operator", "message"),
    [
        (0, "Div", "not all finite"),  # 0 / 0
        (1000, "Add", "cannot answer"),  # a column that is not there
    ],
)
def test_a_network_that_answers_with_no_numbers_drives_nobody(
    first: int, operator: str, message: str, tmp_path: Path
) -> None:
    bad = tmp_path / "bad.onnx"
    nodes = [
        onnx.helper.make_node("Gather", ["observation", "columns"], ["some"], axis=1),
        onnx.helper.make_node("Sub", ["some", "some"], ["nothing"]),
        onnx.helper.make_node(operator, ["nothing", "nothing"], ["action"]),
    ]
    onnx.save(foreign_model(nodes, {"columns": np.arange(first, first + 3)}), bad)
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


@pytest.mark.live
def test_laps_of_a_policy_are_recorded(policy_file: Path, tmp_path: Path) -> None:
    from race_agents.training.film import record_laps
    from race_server.storage.recording.reader import read_recording

    made = record_laps(tmp_path, policy_file.absolute(), "oval", "tt02", seed=1)
    assert made is not None
    assert [path.name for path in tmp_path.iterdir()] == ["laps.mcap"]
    assert read_recording(made).is_complete


@pytest.mark.parametrize(("ticks", "decisions"), [(3, 13), (9, 5), (18, 3)])
def test_a_kart_that_is_stuck_backs_out_after_0_6_s_however_seldom_it_is_asked(
    ticks: int, decisions: int
) -> None:
    driver = Learned("full")
    driver.reset(briefing(driver.preset))
    layout = layout_of(driver.preset, 0)
    stuck = np.zeros(layout.size, np.float32)
    stuck[layout.slices["line_step"]] = 0.2
    stuck[layout.slices["line_ahead_x"]] = 0.2 * np.arange(AHEAD)
    stuck[layout.slices["karts_x"]] = NOWHERE
    told = [driver.act(Observation(ticks * turn, layout, stuck)).throttle for turn in range(20)]
    assert told.index(-1.0) == decisions
