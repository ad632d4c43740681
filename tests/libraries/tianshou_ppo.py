# /// script
# dependencies = ["tianshou==2.0.1"]
# ///
"""Tianshou: PPO over its own vector of Gymnasium's environments."""

import gymnasium
import torch
from tianshou.algorithm import PPO
from tianshou.algorithm.modelfree.reinforce import ProbabilisticActorPolicy
from tianshou.algorithm.optim import AdamOptimizerFactory
from tianshou.data import Collector, VectorReplayBuffer
from tianshou.env import DummyVectorEnv
from tianshou.trainer import OnPolicyTrainerParams
from tianshou.utils.net.common import Net
from tianshou.utils.net.continuous import ContinuousActorProbabilistic, ContinuousCritic


def make() -> gymnasium.Env:
    return gymnasium.make("race_server:Kart/TimeTrial-v0", most_steps=100)


one = make()
seen, acted = one.observation_space.shape, one.action_space.shape
actor = ContinuousActorProbabilistic(
    preprocess_net=Net(state_shape=seen, hidden_sizes=[32]), action_shape=acted, unbounded=True
)
critic = ContinuousCritic(preprocess_net=Net(state_shape=seen, hidden_sizes=[32]))
policy = ProbabilisticActorPolicy(
    actor=actor,
    dist_fn=lambda both: torch.distributions.Independent(torch.distributions.Normal(*both), 1),
    action_space=one.action_space,
)
learner = PPO(policy=policy, critic=critic, optim=AdamOptimizerFactory(lr=1e-3))
vector = DummyVectorEnv([make, make])
result = learner.run_training(
    OnPolicyTrainerParams(
        training_collector=Collector(learner, vector, VectorReplayBuffer(2000, 2)),
        max_epochs=1,
        epoch_num_steps=500,
        collection_step_num_env_steps=250,
        update_step_num_repetitions=1,
        show_progress=False,
        verbose=False,
    )
)
assert result.train_step >= 500
print(f"PPO, {result.train_step} decisions, {result.train_episode} episodes")
