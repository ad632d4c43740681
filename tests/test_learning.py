"""A policy learns: the example's training gains return within seconds."""

import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.slow
@pytest.mark.timeout(300)  # a first start compiles
def test_the_example_learns_within_300_000_decisions(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("stable_baselines3")
    monkeypatch.setattr(sys, "path", [str(EXAMPLES), *sys.path])
    from train_sb3 import Until, new_model

    model, until = new_model(seed=1), Until(seconds=250.0)
    model.learn(300_000, callback=until)
    first, last = np.mean(until.returns[:100]), np.mean(until.returns[-100:])
    # Half a metre at first; a lap is 33 m.
    assert last > first + 33.0, f"mean return {first:.1f} m at first, {last:.1f} m at last"
