"""Two policies in one file: which of them answers an observation says."""

from pathlib import Path

import numpy as np
import pytest

from race_agents.policies.registry import SHIPPED
from race_agents.policies.session import Policy
from race_agents.training.export import difference
from race_agents.training.policy_pair import join_by_chart, join_in_lot, places_of
from race_agents.training.policy_start import begin_with_policy
from race_agents.training.settings_toml import read_settings
from race_server.errors import ScenarioError
from support.trainings import untrained, write_untrained

FAR = SHIPPED / "parking-2.onnx"
SMALL = ("worlds=2", "algorithm.options.batch_size=64")
ON_LINE = ("observation=['speed', 'line_offset', 'line_speed_ahead']", "race.fields=[1]")
ON_OVAL = (*SMALL, "tracks={names = ['oval']}")


def write_near(path: Path, observation: str) -> Path:
    """Write a policy of the yard."""
    return write_untrained(path, "parking-2", *SMALL, f"observation={observation}")


def test_the_second_policy_answers_from_its_distance_on(tmp_path: Path) -> None:
    near = write_near(tmp_path / "near.onnx", '["speed", "goal_distance", "goal_cos"]')
    join_in_lot(tmp_path / "both.onnx", FAR, near, 9.0)
    both = Policy(tmp_path / "both.onnx")
    seen = np.random.default_rng(1).normal(size=(4, both.metadata.size)).astype(np.float32)
    parts = both.metadata.parts
    speed, distance, cos = (
        sum(both.metadata.sizes[: parts.index(name)])
        for name in ("speed", "goal_distance", "goal_cos")
    )
    seen[:, distance] = 40.0, 9.5, 8.5, 0.0
    answers = both.decide(seen)
    assert np.array_equal(answers[:2], Policy(FAR).decide(seen)[:2])
    few = np.ascontiguousarray(seen[:, [speed, distance, cos]])
    assert np.array_equal(answers[2:], Policy(near).decide(few)[2:])


def test_a_training_begins_with_the_one_that_drives_to_the_slot(tmp_path: Path) -> None:
    near = write_near(tmp_path / "near.onnx", '["speed", "goal_distance"]')
    join_in_lot(tmp_path / "both.onnx", FAR, near, 9.0)
    _, world, learner = untrained(read_settings("parking-2", SMALL))
    begin_with_policy(tmp_path / "both.onnx", learner, world)
    seen = world.venv.reset()  # 40 m and more away
    assert difference(Policy(FAR), learner, world, seen) < 1e-5
    world.close()


def test_policies_that_do_not_fit_are_not_joined(tmp_path: Path) -> None:
    both = tmp_path / "both.onnx"
    with pytest.raises(ScenarioError, match=r"parking-1\.onnx: level = 'report-a-1', of the other"):
        join_in_lot(both, FAR, SHIPPED / "parking-1.onnx", 9.0)
    sees_more = write_near(tmp_path / "near.onnx", '["speed", "goal_distance", "position_x"]')
    with pytest.raises(ScenarioError, match="sees position_x, which the other policy does not"):
        join_in_lot(both, FAR, sees_more, 9.0)
    assert not both.exists()


def test_a_policy_by_the_scan_answers_until_there_is_a_line(tmp_path: Path) -> None:
    scan = write_untrained(tmp_path / "scan.onnx", "time-trial", *ON_OVAL)
    line = write_untrained(tmp_path / "line.onnx", "full", *ON_OVAL, *ON_LINE)
    join_by_chart(tmp_path / "both.onnx", scan, line)
    both = Policy(tmp_path / "both.onnx")
    assert both.metadata.charts
    seen = np.random.default_rng(1).normal(size=(4, both.metadata.size)).astype(np.float32)
    places = places_of(both.metadata)
    seen[:2, places["line_step"]], seen[2:, places["line_step"]] = 0.0, 0.2
    answers = both.decide(seen)
    for policy, rows in ((Policy(scan), slice(0, 2)), (Policy(line), slice(2, 4))):
        own = np.concatenate([places[part] for part in policy.metadata.parts])
        alone = policy.decide(np.ascontiguousarray(seen[rows][:, own]))
        assert np.array_equal(answers[rows], alone)


def test_a_training_begins_with_the_one_that_drives_by_the_scan(tmp_path: Path) -> None:
    scan = write_untrained(tmp_path / "scan.onnx", "time-trial", *ON_OVAL)
    line = write_untrained(tmp_path / "line.onnx", "full", *ON_OVAL, *ON_LINE)
    join_by_chart(tmp_path / "both.onnx", scan, line)
    _, world, learner = untrained(read_settings("time-trial", ON_OVAL))
    begin_with_policy(tmp_path / "both.onnx", learner, world)
    assert difference(Policy(scan), learner, world, world.venv.reset()) < 1e-5
    world.close()


def test_policies_that_do_not_race_by_scan_and_line_are_not_joined(tmp_path: Path) -> None:
    both = tmp_path / "both.onnx"
    scan = write_untrained(tmp_path / "scan.onnx", "time-trial", *ON_OVAL)
    with pytest.raises(ScenarioError, match=r"parking-2\.onnx parks: give --within too"):
        join_by_chart(both, FAR, FAR)
    with pytest.raises(ScenarioError, match=r"scan\.onnx: it sees lidar, and has to see the line"):
        join_by_chart(both, scan, scan)
    by_centre = write_untrained(
        tmp_path / "centre.onnx", "time-trial", *ON_OVAL, "observation=['speed', 'left_ahead']"
    )
    with pytest.raises(ScenarioError, match=r"centre\.onnx: it sees left_ahead, and has to"):
        join_by_chart(both, scan, by_centre)
    with pytest.raises(ScenarioError, match=r"full\.onnx: it has to race by a lidar"):
        join_by_chart(both, SHIPPED / "full.onnx", scan)
    assert not both.exists()
