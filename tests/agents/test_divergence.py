"""A training whose network diverges keeps what it had learned before."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from race_agents.training import folder
from race_agents.training.callback import LATEST
from race_agents.training.divergence import has_diverged
from race_agents.training.fast_ppo import FastPpo
from race_agents.training.learner import CLASSES
from race_agents.training.run import train
from race_agents.training.seats import Seats, SharedRaces
from race_agents.training.settings_toml import read_settings
from race_server.errors import ScenarioError
from support.trainings import QUICK, untrained


def diverge_after(decisions: int, monkeypatch: pytest.MonkeyPatch, kind: Any = FastPpo) -> None:
    """Let the first lesson after these decisions ruin the actor."""
    teach = kind.train

    def ruin(learner: Any) -> None:
        teach(learner)
        if learner.num_timesteps >= decisions:
            learner.policy.action_net.weight.data.fill_(np.nan)

    monkeypatch.setattr(kind, "train", ruin)


def is_sound(path: Path) -> bool:
    numbers: dict[str, Any] = torch.load(path, weights_only=True)["parameters"]["policy"]
    return all(bool(torch.isfinite(one).all()) for one in numbers.values())


@pytest.mark.parametrize("algorithm", ["ppo", "ppo-sb3"])
def test_the_best_policy_is_written_and_the_run_goes_on_from_a_sound_checkpoint(
    algorithm: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Evaluated at 1200 decisions of 2000, the network is ruined at 1600."""
    diverge_after(1600, monkeypatch, CLASSES[algorithm])
    said: list[str] = []
    settings = read_settings("time-trial-ppo", [*QUICK, f"algorithm.name={algorithm}"])
    done = train(settings, tmp_path, say=said.append)
    assert done.evaluation["diverged"]
    assert (tmp_path / "policy.onnx").is_file()
    assert any("the best policy so far is evaluated and written" in text for text in said)
    assert is_sound(tmp_path / LATEST)
    monkeypatch.undo()
    again = train(folder.settings_in(tmp_path), tmp_path, resume=True)
    assert again.evaluation["steps"] == 2000
    assert "diverged" not in again.evaluation


def test_without_a_policy_that_was_evaluated_a_smaller_rate_is_asked_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    diverge_after(400, monkeypatch)
    with pytest.raises(ScenarioError, match="before its first evaluation: choose a smaller"):
        train(read_settings("time-trial-ppo", QUICK), tmp_path)
    assert not (tmp_path / LATEST).exists()


def test_a_run_whose_latest_network_has_diverged_goes_on_from_its_best(
    tmp_path: Path,
) -> None:
    settings, said = read_settings("time-trial-ppo", QUICK), list[str]()
    train(settings, tmp_path)
    latest = torch.load(tmp_path / LATEST, weights_only=True)
    latest["parameters"]["policy"]["action_net.bias"].fill_(np.nan)
    torch.save(latest, tmp_path / LATEST)
    more = folder.settings_in(tmp_path, ("steps=2400",))
    assert train(more, tmp_path, resume=True, say=said.append).evaluation["steps"] == 2400
    assert "latest.pt holds a network that has diverged: it goes on from best.pt" in said
    assert is_sound(tmp_path / LATEST)


@pytest.mark.parametrize(("value", "diverged"), [(1e6, False), (1e10, True), (np.nan, True)])
def test_weights_without_bounds_are_no_network(value: float, diverged: bool) -> None:
    _, world, learner = untrained(read_settings("time-trial-ppo", QUICK))
    learner.policy.action_net.weight.data[0, 0] = value
    assert has_diverged(learner) is diverged
    world.close()


def test_a_deviation_that_is_no_number_is_no_network() -> None:
    _, world, learner = untrained(read_settings("time-trial-ppo", QUICK))
    learner.policy.log_std.data.fill_(100.0)
    assert has_diverged(learner)
    world.close()


def test_what_one_policy_answers_without_numbers_reaches_no_other() -> None:
    words = ["worlds=2", "race={karts = 2, learners = 2, opponents = ['raceline']}"]
    policies = "policies=[{name = 'red'}, {name = 'blue'}]"
    settings = read_settings("time-trial-ppo", [*QUICK, *words, policies])
    races = SharedRaces(settings)
    red = Seats(races, settings, 0)
    with pytest.raises(ScenarioError, match="a network that answers so has diverged"):
        races.decide(0, red.karts, np.full((2, 3), np.nan, np.float32))
    assert np.isfinite(races.batch.buffers.actions).all()
    races.batch.close()
