# /// script
# dependencies = ["ray[rllib]==2.60.0"]
# ///
"""RLlib's new stack: PPO with two policies in one race, through its ParallelPettingZooEnv."""

import os

os.environ.setdefault("RAY_DEDUP_LOGS", "1")

import ray
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.rl_module import RLModuleSpec
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env

from race_server.envs import parallel_env

if __name__ == "__main__":
    ray.init(num_cpus=2, include_dashboard=False, logging_level="ERROR")

    def make(_):
        return ParallelPettingZooEnv(parallel_env(track="oval", karts=4, max_cycles=100))

    register_env("karts", make)
    config = (
        PPOConfig()
        .environment("karts")
        .env_runners(num_env_runners=0, rollout_fragment_length=100)
        .training(train_batch_size_per_learner=400, minibatch_size=100, num_epochs=1)
        .multi_agent(
            policies={"odd", "even"},
            policy_mapping_fn=lambda agent, *_, **__: "odd" if int(agent[-1]) % 2 else "even",
        )
        .rl_module(rl_module_spec=RLModuleSpec(model_config={"fcnet_hiddens": [32]}))
        .learners(num_learners=0)
    )
    learner = config.build_algo()
    result = learner.train()
    steps = result["num_env_steps_sampled_lifetime"]
    learners = sorted(result["learners"])
    assert {"odd", "even"} <= set(learners), learners
    learner.stop()
    ray.shutdown()
    print(f"PPO, two policies, {int(steps)} decisions of 4 karts")
