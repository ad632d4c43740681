"""PPO with its gradients written out learns what SB3's learns."""

from typing import Any

import numpy as np
import pytest
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback

from race_agents.training.fast_ppo import FastPpo
from race_agents.training.gaussian_mlp import layers_of
from race_server.envs.sb3 import KartVecEnv
from support.tasks import ring_task

OPTIONS: dict[str, Any] = {
    "n_steps": 32,
    "batch_size": 1024,
    "n_epochs": 3,
    "ent_coef": 0.01,
    "learning_rate": 3e-3,
    "seed": 3,
    "device": "cpu",
}


def learned(
    kind: type[PPO], activation: type[torch.nn.Module], rollouts: int = 3, **options: Any
) -> PPO:
    task = ring_task(4, observation="radar", random_start=True, most_steps=25)
    karts = KartVecEnv(task, worlds=16, seed=1)
    network = {"net_arch": {"pi": [16, 12], "vf": [20, 8]}, "activation_fn": activation}
    learner = kind("MlpPolicy", karts, policy_kwargs=network, **OPTIONS, **options)
    learner.learn(rollouts * 32 * 64)
    karts.close()
    return learner


def flat(learner: PPO) -> torch.Tensor:
    """Return all parameters of a policy."""
    return torch.nn.utils.parameters_to_vector(learner.policy.parameters()).detach()


@pytest.mark.parametrize("activation", [torch.nn.Tanh, torch.nn.ReLU])
@pytest.mark.parametrize("threads", [1, 2])
def test_three_rollouts_leave_the_parameters_of_the_reference(
    activation: type[torch.nn.Module], threads: int
) -> None:
    reference, fast = learned(PPO, activation), learned(FastPpo, activation, threads=threads)
    first = PPO("MlpPolicy", reference.env, policy_kwargs=reference.policy_kwargs, **OPTIONS)
    pairs = zip(reference.policy.parameters(), fast.policy.parameters(), strict=True)
    for (one, other), begun in zip(pairs, first.policy.parameters(), strict=True):
        way, apart = (one - begun).abs().max().item(), (one - other).abs().max().item()
        assert apart < 0.02 * way
    assert fast.logger.name_to_value.keys() == reference.logger.name_to_value.keys()


@pytest.mark.parametrize("kind", [PPO, FastPpo])
def test_after_a_callback_has_begun_other_races_it_decides_on_what_is_seen_there(
    kind: type[PPO],
) -> None:
    class Elsewhere(BaseCallback):
        def _on_rollout_start(self) -> None:
            self.model._last_obs = np.full_like(self.model._last_obs, 0.25)

        def _on_step(self) -> bool:
            return True

    karts = KartVecEnv(ring_task(1, observation="radar"), worlds=2, seed=1)
    learner = kind("MlpPolicy", karts, **{**OPTIONS, "n_steps": 4, "batch_size": 8})
    learner.learn(8, callback=Elsewhere())
    seen = np.asarray(learner.rollout_buffer.observations).reshape(2, 4, -1)  # (world, step, …)
    assert np.all(seen[:, 0] == 0.25)
    assert not np.any(np.all(seen[:, 1] == 0.25, axis=-1))
    karts.close()


def test_with_halves_its_parameters_go_the_same_way() -> None:
    first, exact, half = (
        flat(learner)
        for learner in (
            learned(FastPpo, torch.nn.ReLU, rollouts=0),
            learned(FastPpo, torch.nn.ReLU),
            learned(FastPpo, torch.nn.ReLU, halves=True),
        )
    )
    way, other_way = exact - first, half - first
    assert torch.dot(way, other_way) > 0.9 * way.norm() * other_way.norm()


def test_it_goes_on_from_its_checkpoint(tmp_path: Any) -> None:
    fast = learned(FastPpo, torch.nn.Tanh, threads=2)
    fast.save(tmp_path / "it.zip")
    again = FastPpo.load(tmp_path / "it.zip", env=fast.env)
    before = [value.clone() for value in again.policy.parameters()]
    again.learn(32 * 64)
    assert any(
        not torch.equal(a, b) for a, b in zip(before, again.policy.parameters(), strict=True)
    )


def test_a_critic_learns_alone_while_the_actor_is_held() -> None:
    fast: Any = learned(FastPpo, torch.nn.Tanh)
    held = [*fast.policy.mlp_extractor.policy_net, fast.policy.action_net]
    for module in held:
        module.requires_grad_(requires_grad=False)
    fast.policy.log_std.requires_grad_(requires_grad=False)
    before = {name: value.clone() for name, value in fast.policy.state_dict().items()}
    fast.learn(32 * 64)
    after = fast.policy.state_dict()
    changed = {name for name, value in before.items() if not torch.equal(value, after[name])}
    assert changed == {name for name in before if "value_net" in name}


def test_what_is_not_dense_and_gaussian_is_left_to_the_reference() -> None:
    karts = KartVecEnv(ring_task(1, action="discrete"), worlds=2)
    learner = FastPpo("MlpPolicy", karts, n_steps=8, batch_size=8, n_epochs=1, device="cpu")
    assert layers_of(learner.policy) is None
    learner.learn(16)
    assert learner.num_timesteps == 16
    assert np.isfinite(learner.policy.action_net.weight.detach().numpy()).all()
    karts.close()
