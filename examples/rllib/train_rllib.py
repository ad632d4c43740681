"""Train eight karts to race one another with RLlib: ``python train_rllib.py --seconds 60``.

All karts share one policy, and each episode is one race.
"""

import argparse
import time
from typing import Any

from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.env.wrappers.pettingzoo_env import ParallelPettingZooEnv
from ray.tune.registry import register_env

from race_server.envs import parallel_env


def race(_: dict[str, Any]) -> ParallelPettingZooEnv:
    """Return a race that is cut off after 30 seconds."""
    return ParallelPettingZooEnv(parallel_env(max_cycles=600))


def main() -> None:
    """Train, and print the mean return of an episode after every iteration."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    register_env("kart_race", race)
    config = (
        PPOConfig()
        .environment("kart_race")
        .env_runners(num_env_runners=1)
        .training(train_batch_size=1800, minibatch_size=512, num_epochs=5, lr=5e-4, gamma=0.98)
        .multi_agent(policies={"kart"}, policy_mapping_fn=lambda *_, **__: "kart")
        .debugging(seed=chosen.seed)
    )
    algorithm = config.build_algo()
    end = time.monotonic() + chosen.seconds
    while time.monotonic() < end:
        result = algorithm.train()
        total = result["env_runners"].get("episode_return_mean", float("nan"))
        print(f"iteration {result['training_iteration']}: return of all karts {total:.1f}")
    algorithm.stop()


if __name__ == "__main__":
    main()
