"""The list of policies: a damaged file of one run hides no other."""

import json
import shutil
from pathlib import Path

import pytest

from race_agents.policies.listing import entries
from race_agents.policies.registry import EVALUATION, POLICY, SHIPPED

FIGURES = {"track": "all", "speed": 2.0, "crash_rate": 0.5, "laps": 3, "best_lap_s": 9.0}
GOOD = json.dumps({"tracks": [FIGURES | {"reward": 1.0}]})


@pytest.mark.parametrize(
    ("evaluation", "speed"),
    [
        (GOOD, 2.0),
        (GOOD.replace("9.0", "null"), 2.0),
        (GOOD.replace("2.0", '"fast"'), None),
        (GOOD.replace("2.0", "null"), None),
        (GOOD.replace("2.0", "NaN"), None),
        (GOOD.replace("9.0", "Infinity"), None),
        ("[" * 100_000, None),
    ],
)
def test_figures_that_are_none_are_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, evaluation: str, speed: float | None
) -> None:
    run = tmp_path / "mine"
    run.mkdir()
    shutil.copy(SHIPPED / "time-trial.onnx", run / POLICY)
    (run / EVALUATION).write_text(evaluation)
    monkeypatch.setattr("race_agents.policies.registry.runs_folder", lambda: tmp_path)
    (mine,) = [one for one in entries() if one.is_run]
    assert (mine.vehicle, mine.evaluation.get("speed")) == ("tt02", speed)


def test_policies_that_learned_together_are_listed_each(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("race_agents.policies.registry.runs_folder", lambda: tmp_path)
    for name in ("alone", "duel/red", "duel/blue"):
        (tmp_path / name).mkdir(parents=True)
        shutil.copy(SHIPPED / "time-trial.onnx", tmp_path / name / POLICY)
    assert [one.name for one in entries() if one.is_run] == ["alone", "duel/blue", "duel/red"]
