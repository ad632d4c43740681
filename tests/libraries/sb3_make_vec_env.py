# /// script
# dependencies = ["stable-baselines3==2.9.2"]
# ///
"""Stable-Baselines3 alone: its own vector of Gymnasium's environments, in processes, and SAC."""

from stable_baselines3 import SAC
from stable_baselines3.common.env_util import make_vec_env
from stable_baselines3.common.vec_env import SubprocVecEnv

import race_server.envs  # noqa: F401  # registers the ids

if __name__ == "__main__":
    vector = make_vec_env("Kart/TimeTrial-v0", 2, seed=1, vec_env_cls=SubprocVecEnv)
    learner = SAC("MlpPolicy", vector, learning_starts=100, device="cpu")
    learner.learn(200)
    print(f"SAC, {learner.num_timesteps} decisions in two processes")
    vector.close()
