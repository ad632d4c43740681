"""A training that starts with the network of a policy file."""

from pathlib import Path

import numpy as np
import pytest

from race_agents.policies.registry import SHIPPED
from race_agents.policies.session import Policy
from race_agents.training.export import difference
from race_agents.training.policy_start import begin_with_policy
from race_agents.training.schedule import Schedule
from race_agents.training.settings_toml import read_settings
from race_server.errors import ScenarioError
from support.trainings import untrained

YARD = SHIPPED / "parking-2.onnx"


def begin(preset: str, path: Path, *changes: str) -> None:
    _, world, learner = untrained(
        read_settings(preset, ["worlds=2", "algorithm.options.batch_size=64", *changes])
    )
    try:
        begin_with_policy(path, learner, world)
        seen = world.venv.reset()
        assert difference(Policy(path), learner, world, seen) < 1e-5
        assert np.abs(learner.policy.value_net.weight.detach().numpy()).max() == 0.0
        assert learner.num_timesteps == 0
    finally:
        world.close()


def test_a_learner_answers_as_the_file_that_it_begins_with() -> None:
    begin("parking-2", YARD)


def test_what_the_file_decorrelates_the_learner_decorrelates() -> None:
    begin("park", SHIPPED / "park.onnx")


@pytest.mark.parametrize(
    "change", ["network.layers=[64, 64]", "observation=park", "parking.logarithms=false"]
)
def test_a_file_of_another_network_or_view_is_refused(change: str) -> None:
    with pytest.raises(ScenarioError, match=r"parking-2\.onnx: the training has another network"):
        begin("parking-2", YARD, change)


def test_the_critic_learns_alone_before_an_actor_from_a_file_goes_on() -> None:
    begun = read_settings("parking-2", ["warm_start.policy=parking-2"]).warm_start
    assert (begun.end, begun.critic_end) == (0.0, begun.critic_share)
    assert read_settings("parking-2", ["warm_start.run=parking-2-1"]).warm_start.critic_end == 0.0


@pytest.mark.parametrize("last", ["none", "-1.5"])
@pytest.mark.parametrize(("given", "first"), [("-3.5", -3.5), ("none", -1.2)])
def test_the_first_deviation_is_that_of_the_warm_start_where_it_is_given(
    given: str, first: float, last: str
) -> None:
    """Without it that of the network counts, -1.2."""
    small = ("worlds=2", "algorithm.options.batch_size=64")
    changes = (*small, f"warm_start.log_std={given}", f"network.last_log_std={last}")
    wanted = read_settings("parking-2-karts", changes)
    budget, world, learner = untrained(wanted)
    schedule = Schedule(wanted, budget)
    schedule.init_callback(learner)
    schedule.on_rollout_start()
    assert learner.policy.log_std.tolist() == pytest.approx([first, first])
    world.close()
