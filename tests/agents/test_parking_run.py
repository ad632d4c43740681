"""A whole run of a training in a lot, and what it leaves."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from race_agents.drivers.learned import Learned
from race_agents.policies.listing import entries
from race_agents.policies.registry import SHIPPED
from race_agents.policies.session import Policy
from race_agents.policies.verification import observations_of
from race_agents.training import curve
from race_agents.training.callback import BEST, CURVE
from race_agents.training.checkpoint import begin_with
from race_agents.training.run import TrainingResult
from race_agents.training.tasks import training_task
from race_server.competition.time_trial.run import numbers_of
from race_server.core.driver import Briefing
from race_server.core.observation import Observation, layout_of
from race_server.core.vehicle_presets import KART_13
from race_server.envs.batch import Batch
from race_server.envs.presets import parking_task
from race_server.errors import DriverError
from race_server.scenario.sensors import Lidar
from support.lot_trainings import FAR, NEAR, QUICK, settings, write_shown
from support.trainings import Train, untrained

# A whole run: everything beside the reward at once.
WHOLE = (
    *QUICK,
    "parking.logarithms=true",
    "observation=park",
    "curiosity={bonus = 0.1, hidden = 8}",
    f"curriculum=[{NEAR}, {FAR}]",
)


@pytest.fixture(scope="module")
def shown(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_shown(tmp_path_factory.mktemp("shown") / "shown.npz", steering=0.0)


@pytest.fixture(scope="module")
def run(trained: Train, shown: Path) -> TrainingResult:
    imitation = (f"gail={{demonstrations = '{shown}', layers = [8]}}",)
    return trained("parking-1", (*WHOLE, *imitation, f"cloning.demonstrations={shown}"))


def test_a_run_in_a_lot_leaves_a_complete_folder(run: TrainingResult) -> None:
    names = {path.name for path in run.folder.iterdir()}
    assert {"policy.onnx", "evaluation.json", "curve.png", "parking.mcap", "README.md"} <= names
    assert [row["lot"] for row in run.evaluation["lots"]] == ["face-to-face", "all"]
    assert run.evaluation["lots"][0]["episodes"] == 3
    assert run.evaluation["parity"] <= 1e-5
    rows = curve.read(run.folder / CURVE)
    assert {"tried_parked", "tried_aligned", "tried_hits", "stage"} <= set(rows[-1])
    text = (run.folder / "README.md").read_text()
    assert "| lot | parked [%] |" in text
    assert "race policy check" in text


def test_a_file_says_where_and_how_well_it_learned_to_park(run: TrainingResult) -> None:
    metadata = Policy(run.folder / "policy.onnx").metadata
    assert (metadata.lots, metadata.tracks) == (("face-to-face",), ())
    assert (metadata.level, metadata.decision_s) == ("report-a-1", 0.1)
    older = Policy(SHIPPED / "time-trial.onnx").metadata
    assert (older.lots, older.level) == ((), "")


def test_a_policy_is_verified_in_its_own_lot_and_in_unseen_ones(run: TrainingResult) -> None:
    policy = Policy(run.folder / "policy.onnx")
    assert observations_of(policy, 40).shape == (40, policy.metadata.size)


def test_a_list_of_policies_shows_how_many_park(
    run: TrainingResult, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("race_agents.policies.registry.runs_folder", lambda: run.folder.parent)
    (mine,) = [one for one in entries() if one.is_run]
    assert mine.lots == ("face-to-face",)
    assert mine.evaluation["success_rate"] == run.evaluation["lots"][-1]["success_rate"]


def test_a_run_begins_with_what_another_one_learned(run: TrainingResult) -> None:
    wanted = settings("observation=park", "parking.logarithms=true", f"warm_start.run={run.folder}")
    _, world, learner = untrained(wanted)
    before = learner.policy.action_net.weight.clone()
    begin_with(run.folder / BEST, learner, world)
    stored = torch.load(run.folder / BEST, weights_only=True)["parameters"]["policy"]
    assert torch.equal(learner.policy.action_net.weight, stored["action_net.weight"])
    assert not torch.equal(learner.policy.action_net.weight, before)
    assert learner.num_timesteps == 0
    world.close()


def test_other_karts_in_a_lot_drive_what_was_learned_before(run: TrainingResult) -> None:
    others = f"race={{karts = 3, opponents = ['learned:{run.folder / 'policy.onnx'}']}}"
    # The level of the preset would end an episode 30 m away from the slot.
    yard = ("parking.lots=['yard-70']", "parking.level=report-a-2")
    batch = Batch(training_task(settings(*yard, others)), worlds=2, seed=4)
    assert batch.observations.shape[:2] == (2, 1)  # one learns
    batch.step(np.zeros((2, 1, 2), np.float32))
    assert (np.abs(batch.buffers.controls[:, 1:, :2]).max(axis=2) > 0.0).all()
    assert len({int(one) for one in (batch.world.parking.parkers["x"][0] * 1000.0)}) == 3
    batch.close()


def briefing(decision_s: float) -> Briefing:
    lidar = Lidar()
    return Briefing(
        seat=0,
        vehicle=KART_13,
        preset="lot",
        laps=0,
        decision_s=decision_s,
        lidar_field=lidar.field,
        lidar_reach=lidar.reach,
    )


def test_a_driver_in_a_lot_does_what_the_policy_did_in_training(run: TrainingResult) -> None:
    path = run.folder / "policy.onnx"
    policy, driver = Policy(path), Learned(str(path))
    trained = Batch(parking_task("zone-30", observation=policy.metadata.parts), seed=3)
    raced = Batch(parking_task("zone-30", observation="lot", action="control"), seed=3)
    driver.reset(briefing(0.1))
    for step in range(30):
        trained.step(policy.decide(trained.observations[:, 0]))
        seen = Observation(6 * step, raced.layout, raced.observations[0, 0].copy())
        raced.step(numbers_of(driver.act(seen)))
        assert raced.world.bodies[0, 0].x == pytest.approx(trained.world.bodies[0, 0].x, abs=1e-6)


def test_a_driver_keeps_its_own_pace_where_decisions_come_more_often(run: TrainingResult) -> None:
    driver = Learned(str(run.folder / "policy.onnx"))
    driver.reset(briefing(0.05))
    chance = np.random.default_rng(2)
    layout = layout_of("lot", Lidar().rays)

    def answer(tick: int) -> Any:
        values = chance.normal(0.0, 1.0, layout.size).astype(np.float32)
        values[[layout.slices[name].start for name in ("lights", "finished")]] = 0.0
        return driver.act(Observation(tick, layout, values))

    first = answer(0)
    assert answer(3) is first
    second = answer(6)
    assert second != first
    driver.reset(briefing(0.05))
    late = answer(15)  # asked for the first time between two decisions of training
    assert answer(18) is not late
    with pytest.raises(DriverError, match=r"every 0\.1 s, not every 0\.075 s"):
        driver.reset(briefing(0.075))
