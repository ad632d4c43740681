"""Observations as a network takes them: with mean 0 and variance 1, unless they never changed."""

import gymnasium
import numpy as np
import pytest
from stable_baselines3.common.vec_env import DummyVecEnv

from race_agents.training.normaliser import Normaliser
from race_agents.training.view import NOWHERE, ObservationView


class _ThreeNumbers(gymnasium.Env[np.ndarray, np.ndarray]):
    """Shows -2 or 2, by turns, and a second and a third number that stay 0.3 and 0."""

    observation_space = gymnasium.spaces.Box(-10.0, 10.0, (3,))
    action_space = gymnasium.spaces.Box(-1.0, 1.0, (1,))

    def __init__(self) -> None:
        self.sign = 1.0

    def reset(self, **_: object) -> tuple[np.ndarray, dict[str, object]]:
        return self._seen(), {}

    def step(self, action: np.ndarray) -> tuple[np.ndarray, float, bool, bool, dict[str, object]]:
        self.sign = -self.sign
        return self._seen(), 0.0, False, False, {}

    def _seen(self) -> np.ndarray:
        return np.array([2.0 * self.sign, 0.3, 0.0], np.float32)


@pytest.fixture
def normaliser() -> Normaliser:
    """Return a normaliser that has seen a thousand observations."""
    untouched = ObservationView(np.float32(np.inf), NOWHERE, NOWHERE, NOWHERE, np.zeros(0), NOWHERE)
    world = Normaliser(DummyVecEnv([_ThreeNumbers]), untouched, norm_reward=False)
    world.reset()
    for _ in range(1000):
        world.step(np.zeros((1, 1), np.float32))
    return world


def test_a_number_that_changes_gets_mean_0_and_variance_1(normaliser: Normaliser) -> None:
    rows = normaliser.normalize_obs(np.array([[2.0, 0.3, 0.0], [-2.0, 0.3, 0.0]]))

    assert rows[:, 0] == pytest.approx([1.0, -1.0], abs=0.01)


def test_a_number_that_never_changed_does_not_saturate_when_it_does(normaliser: Normaliser) -> None:
    rows = normaliser.normalize_obs(np.array([[2.0, 0.3, 0.0], [2.0, 0.8, -1.0]]))

    assert rows[0, 1:] == pytest.approx([0.0, 0.0], abs=0.001)
    assert rows[1, 1:] == pytest.approx([0.5, -1.0], abs=0.001)


def test_what_is_normalised_can_be_taken_back(normaliser: Normaliser) -> None:
    seen = np.array([[1.5, 0.8, -1.0]])

    assert normaliser.unnormalize_obs(normaliser.normalize_obs(seen)) == pytest.approx(seen, 1e-6)


def test_without_normalisation_14_m_stay_14_m(normaliser: Normaliser) -> None:
    normaliser.norm_obs = False
    seen = np.array([[14.0, -25.0, 0.0]])

    assert normaliser.normalize_obs(seen).tolist() == seen.tolist()
    assert normaliser.unnormalize_obs(seen).tolist() == seen.tolist()


def test_imitation_scales_as_reinforcement_does(normaliser: Normaliser) -> None:
    seen = np.array([[1.5, 0.8, -1.0]], np.float32)

    assert normaliser.scaled(seen) == pytest.approx(normaliser.normalize_obs(seen), abs=1e-6)
