"""A policy learns: the example's training gains return within seconds."""

import sys
from pathlib import Path

import pytest

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.mark.slow
@pytest.mark.timeout(300)  # a first start compiles
def test_the_example_learns_within_300_000_decisions(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("stable_baselines3")
    monkeypatch.setattr(sys, "path", [str(EXAMPLES), *sys.path])
    from train_sb3 import mean_return, new_model

    model = new_model()
    model.learn(20_000)
    first = mean_return(model)
    model.learn(280_000, reset_num_timesteps=False)
    # Half a metre at first; a lap is 33 m.
    assert mean_return(model) > first + 33.0, f"from {first:.1f} m to {mean_return(model):.1f} m"
