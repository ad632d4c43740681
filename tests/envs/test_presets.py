"""Each preset makes a task that can be stepped."""

from collections.abc import Callable

import numpy as np
import pytest

from race_server import envs
from race_server.envs.task import Task
from race_server.envs.vector import KartVectorEnv

PRESETS = [name for name in envs.__all__ if name.endswith("_task")]


def test_the_presets_are_these() -> None:
    assert PRESETS == ["mixed_task", "parking_task", "race_task", "time_trial_task"]


PLACES = {"parking_task": ["generated:yard:1", "face-to-face"]}


@pytest.mark.parametrize(
    ("preset", "place"),
    [
        (preset, place)
        for preset in PRESETS
        for place in PLACES.get(preset, ["oval", "covapsy-train-2023"])
    ],
)
def test_a_preset_is_reset_and_stepped_with_finite_observations(preset: str, place: str) -> None:
    make: Callable[[str], Task] = getattr(envs, preset)
    karts = KartVectorEnv(make(place), worlds=2)
    karts.action_space.seed(1)
    seen = [karts.reset(seed=1)[0]]
    for _ in range(3):
        observations, rewards, ended, cut, _ = karts.step(karts.action_space.sample())
        seen.append(observations)
        assert np.isfinite(rewards).all()
        assert not ended.any()
        assert not cut.any()
    assert np.isfinite(seen).all()
    assert all(karts.observation_space.contains(observations) for observations in seen)
    assert not np.array_equal(seen[0], seen[-1])
    karts.close()
