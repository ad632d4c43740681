"""A policy learns: the example's training gains return within seconds."""

import sys
from pathlib import Path

import numpy as np
import pytest

EXAMPLES = Path(__file__).parents[1] / "examples"


@pytest.mark.slow
@pytest.mark.timeout(300)  # a first start compiles
def test_the_example_learns_within_half_a_minute(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("stable_baselines3")
    monkeypatch.setattr(sys, "path", [str(EXAMPLES), *sys.path])
    from train_sb3 import new_model, train

    returns = train(new_model(seed=1), seconds=25.0)
    assert len(returns) >= 300
    first, last = np.mean(returns[:100]), np.mean(returns[-100:])
    # About one metre at first and 100 at last; a lap is 33 m.
    assert last > first + 10.0, f"mean return {first:.1f} m at first, {last:.1f} m at last"
