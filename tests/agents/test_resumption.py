"""A run goes on after whatever ended it, and with whatever settings were tried on it."""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
import torch

from race_agents.commands.policy import _difference
from race_agents.policies.registry import BEST, CONFIG, EVALUATION, POLICY
from race_agents.training import folder
from race_agents.training.callback import CURVE, LATEST
from race_agents.training.resumption import has_gone_on, is_complete
from race_agents.training.run import TrainingResult, train
from race_server.errors import RaceError, ScenarioError


@pytest.fixture
def run(outcome: TrainingResult, tmp_path: Path) -> Path:
    """The folder of a run that is complete."""
    for path in filter(Path.is_file, outcome.folder.iterdir()):
        (tmp_path / path.name).write_bytes(path.read_bytes())
    return tmp_path


@pytest.mark.parametrize(
    "change",
    [
        "cloning.demonstrations=/nowhere/laps.npz",
        "warm_start={demonstrations = '/nowhere/laps.npz', share = 0.9}",
    ],
)
def test_settings_under_which_nothing_was_learned_do_not_stay(run: Path, change: str) -> None:
    """The next `--resume` would fail by them, too."""
    before = (run / CONFIG).read_bytes()
    with pytest.raises(RaceError, match="no such file"):
        train(folder.settings_in(run, ("steps=2800", change)), run, resume=True)
    assert (run / CONFIG).read_bytes() == before


def test_a_full_disk_takes_no_settings_from_a_run(run: Path) -> None:
    before, settings = (run / CONFIG).read_bytes(), folder.settings_in(run)
    with patch.object(os, "fsync", side_effect=OSError(28, "No space left on device")):
        with pytest.raises(OSError, match="No space"):
            folder.begin(run, settings)
        with pytest.raises(OSError, match="No space"):
            folder.write_evaluation(run, {})
    assert (run / CONFIG).read_bytes() == before
    assert not list(run.glob("*.part"))


def test_a_run_is_complete_once_its_last_file_is_there(run: Path) -> None:
    """It was killed while its laps were recorded: picture, page and recording are missing."""
    settings, order = folder.settings_in(run), list[str]()
    for name in (EVALUATION, "README.md", "curve.png"):
        (run / name).unlink()
    assert not is_complete(run, settings)
    write: Callable[..., Any] = folder.write_together

    def note(files: dict[Path, bytes]) -> None:
        order.extend(path.name for path in files)
        write(files)

    with patch.object(folder, "write_together", note):
        train(settings, run, resume=True)
    assert order[-2:] == ["README.md", EVALUATION]
    assert (run / "curve.png").exists()
    assert is_complete(run, settings)


def test_a_policy_is_not_compared_with_a_learner_that_has_gone_on_since(run: Path) -> None:
    """It was resumed and killed: nothing is wrong with the file of before."""
    assert not has_gone_on(run, folder.settings_in(run))
    (run / EVALUATION).write_text('{"steps": 1000}')
    none, remark = _difference(run / POLICY, loaded=None, seen=None)
    assert none is None
    assert "has learned since this file was written; `race train --resume" in remark
    (run / EVALUATION).unlink()
    assert not has_gone_on(run, folder.settings_in(run))


def test_a_checkpoint_that_holds_code_is_refused_without_advice_to_run_it(run: Path) -> None:
    content = torch.load(run / LATEST, weights_only=True)
    torch.save({**content, "parameters": Path("code")}, run / LATEST)
    with pytest.raises(
        ScenarioError, match=r"latest.pt: damaged, or no checkpoint: it holds other than"
    ):
        train(folder.settings_in(run, ("steps=2800",)), run, resume=True)


def test_a_checkpoint_of_another_network_is_refused_in_one_line(run: Path) -> None:
    settings = folder.settings_in(run, ("steps=2800", "network.layers=[8]"))
    with pytest.raises(ScenarioError, match=r"of other settings: .*size mism") as caught:
        train(settings, run, resume=True)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 300 + len(str(run / BEST))
    assert (run / CURVE).exists()
