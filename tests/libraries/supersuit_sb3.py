# /// script
# dependencies = ["supersuit==3.11.0"]
# ///
"""SuperSuit and Stable-Baselines3, as in PettingZoo's tutorial: a race as one vector, PPO on it."""

import supersuit
from stable_baselines3 import PPO

from race_server.envs import parallel_env

env = parallel_env(track="oval", karts=4, max_cycles=100)
env = supersuit.black_death_v3(env)
vector = supersuit.pettingzoo_env_to_vec_env_v1(env)
vector = supersuit.concat_vec_envs_v1(vector, 2, num_cpus=1, base_class="stable_baselines3")
learner = PPO("MlpPolicy", vector, n_steps=64, batch_size=256, n_epochs=2, device="cpu")
learner.learn(1024)
assert learner.num_timesteps >= 1024
print(f"PPO, {learner.num_timesteps} decisions of 2 races of 4 karts")
