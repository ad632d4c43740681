"""Several vehicles of a lot that learn together, in the trainer."""

from typing import Any

import numpy as np
import pytest
import torch

from race_agents.policies.session import Policy
from race_agents.reproductions.parking_exam import examine_parking
from race_agents.reproductions.plan import ParkingExam
from race_agents.training.active_rollout import ActiveRollout
from race_agents.training.budget import Budget
from race_agents.training.callback import BEST
from race_agents.training.checkpoint import load_checkpoint
from race_agents.training.parking_marks import ParkingMarks, marks_of
from race_agents.training.poca import Poca
from race_agents.training.run import TrainingResult
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from race_server.competition.team_tally import TeamTally
from race_server.envs.sb3 import KartVecEnv
from race_server.errors import ScenarioError
from support.trainings import Train, untrained

QUICK = (
    "worlds=4",
    "steps=256",
    "parking.limit_s=2.0",
    "network.layers=[8]",
    "algorithm.options={n_steps = 16, batch_size = 64, n_epochs = 1}",
    "evaluation={score = 'success', seeds = 3, times = 1}",
)


def settings(*changes: str) -> Settings:
    return read_settings("park-gate", [*QUICK, *changes])


def episode(ending: str, time_s: float = 5.0) -> dict[str, Any]:
    parked = ending == "parked"
    figures = dict.fromkeys(("direction_changes", "walked_into", "path_m", "r"), 0)
    return {**figures, "is_success": parked, "aligned": parked, "ending": ending, "time_s": time_s}


def test_a_round_counts_as_parked_once_all_its_vehicles_are() -> None:
    """Of four rounds one is whole, one has a contact, one waits; the fourth does both."""
    rounds = ("parked parked", "parked wall", "late parked", "late vehicle")
    every = [episode(ending) for words in rounds for ending in words.split()]
    every[1]["time_s"] = 7.0
    tally = TeamTally.of(every, 2)
    assert (tally.rounds, tally.all_parked, tally.contacts, tally.stuck) == (4, 1, 2, 1)
    assert (tally.all_parked_rate, tally.last_s_mean) == (0.25, 7.0)
    marks = marks_of("all", every, 2)
    assert str(marks).endswith("in 8; all 2 in 25.0 %")
    assert len(marks.cells()) == len(marks.heads) == 8
    assert len(marks_of("all", every).heads) == 5


def test_an_exam_of_several_counts_rounds_beside_starts() -> None:
    def stand(seen: Any) -> Any:
        return np.zeros((len(seen), 2), np.float32)

    figures = examine_parking(settings(), ParkingExam(starts=3), stand)
    assert (figures["starts"], figures["rounds"]) == (6, 3)
    assert (figures["all_parked"], figures["contacts"], figures["stuck"]) == (0, 0, 3)


def test_karts_that_wait_for_the_others_are_not_active() -> None:
    _, world, _ = untrained(settings())
    karts = world.unwrapped
    assert isinstance(karts, KartVecEnv)
    world.reset()
    karts.batch.buffers.idle[1, 0] = 1
    active: Any = world.active  # type: ignore[attr-defined]
    assert active.tolist() == [True, True, False, True, True, True, True, True]
    world.close()


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        ("algorithm.name=poca", Poca),
        ("algorithm.name=ppo", ActiveRollout),
        ("parking.team=true", None),
    ],
)
def test_who_learns_how_from_several(change: str, kind: type | None) -> None:
    name = () if change == "algorithm.name=poca" else ("algorithm.name=ppo",)
    _, world, learner = untrained(settings(*name, change))
    assert (kind is Poca) == isinstance(learner, Poca)
    assert (kind is ActiveRollout) == isinstance(learner.rollout_buffer, ActiveRollout)
    assert world.num_envs == 8
    world.close()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (("algorithm={name = 'sac'}",), "only ppo and poca learn from several vehicles"),
        (("parking.team=true",), "takes the mean of all rewards by itself"),
        (("curiosity.bonus=0.1",), "would judge vehicles that wait"),
        (("warm_start.demonstrations=x.npz",), "critic is of another kind"),
    ],
)
def test_what_several_cannot_have_is_refused(changes: tuple[str, ...], message: str) -> None:
    with pytest.raises(ScenarioError, match=message):
        settings(*changes)


def test_karts_of_a_race_cannot_be_a_group() -> None:
    with pytest.raises(ScenarioError, match="so that no group ends"):
        read_settings("time-trial-ppo", ["algorithm.name=poca", "race={karts = 2, learners = 2}"])


@pytest.fixture(scope="module")
def run(trained: Train) -> TrainingResult:
    return trained("park-gate", QUICK)


def test_a_training_of_several_leaves_a_policy_for_each(run: TrainingResult) -> None:
    assert Policy(run.folder / "policy.onnx").metadata.algorithm == "poca"
    assert run.evaluation["parity"] <= 1e-5
    assert run.evaluation["lots"][-1]["teams"]["rounds"] == 3
    marks = run.marks[-1]
    assert isinstance(marks, ParkingMarks)
    assert marks.tally.episodes == 6
    assert "all parked [%]" in (run.folder / "README.md").read_text()
    assert (run.folder / "parking.mcap").is_file()


def test_a_training_goes_on_from_its_checkpoint(run: TrainingResult) -> None:
    _, world, learner = untrained(settings())
    budget, weight = Budget.of(settings()), learner.policy.critic.attention.in_proj_weight
    before = weight.clone()
    load_checkpoint(run.folder / BEST, learner, world, budget)
    stored = torch.load(run.folder / BEST, weights_only=True)["parameters"]["policy"]
    assert torch.equal(weight, stored["value_net.attention.in_proj_weight"])
    assert not torch.equal(weight, before)  # the critic has learned, and is kept
    assert budget.done >= 128
    world.close()
