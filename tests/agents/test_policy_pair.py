"""Two policies in one file: which of them answers depends on how far the slot is."""

from pathlib import Path

import numpy as np
import pytest

from race_agents.policies.registry import SHIPPED
from race_agents.policies.session import Policy
from race_agents.training.export import difference, export_policy, metadata_from
from race_agents.training.policy_pair import join_policies
from race_agents.training.policy_start import begin_with_policy
from race_agents.training.settings_toml import read_settings
from race_server.errors import ScenarioError
from support.trainings import untrained

FAR = SHIPPED / "parking-2.onnx"
SMALL = ("worlds=2", "algorithm.options.batch_size=64")


def write_near(path: Path, observation: str) -> Path:
    """Write a policy of the yard before it has learned."""
    wanted = read_settings("parking-2", [*SMALL, f"observation={observation}"])
    _, world, learner = untrained(wanted)
    export_policy(path, learner, world, metadata_from(wanted, ("yard-70",)))
    world.close()
    return path


def test_the_second_policy_answers_from_its_distance_on(tmp_path: Path) -> None:
    near = write_near(tmp_path / "near.onnx", '["speed", "goal_distance", "goal_cos"]')
    join_policies(tmp_path / "both.onnx", FAR, near, 9.0)
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
    join_policies(tmp_path / "both.onnx", FAR, near, 9.0)
    _, world, learner = untrained(read_settings("parking-2", SMALL))
    begin_with_policy(tmp_path / "both.onnx", learner, world)
    seen = world.venv.reset()  # 40 m and more away
    assert difference(Policy(FAR), learner, world, seen) < 1e-5
    world.close()


def test_policies_that_do_not_fit_are_not_joined(tmp_path: Path) -> None:
    both = tmp_path / "both.onnx"
    with pytest.raises(ScenarioError, match=r"parking-1\.onnx: level = 'report-a-1', of the other"):
        join_policies(both, FAR, SHIPPED / "parking-1.onnx", 9.0)
    sees_more = write_near(tmp_path / "near.onnx", '["speed", "goal_distance", "position_x"]')
    with pytest.raises(ScenarioError, match="sees position_x, which the other policy does not"):
        join_policies(both, FAR, sees_more, 9.0)
    assert not both.exists()
