# /// script
# dependencies = ["sb3-contrib==2.9.2"]
# ///
"""sb3-contrib: MaskablePPO on discrete actions with masks, and RecurrentPPO."""

import gymnasium
from sb3_contrib import MaskablePPO, RecurrentPPO
from sb3_contrib.common.maskable.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecMonitor

from race_server.envs import KartVecEnv, time_trial_task

env = gymnasium.make("race_server:Kart/TimeTrial-v0", action="discrete", most_steps=100)
masked = MaskablePPO("MlpPolicy", env, n_steps=128, n_epochs=2, device="cpu")
masked.learn(256)
evaluate_policy(masked, env, n_eval_episodes=1, warn=False)
vector = VecMonitor(KartVecEnv(time_trial_task(action="discrete"), worlds=4))
masked = MaskablePPO("MlpPolicy", vector, n_steps=32, n_epochs=1, device="cpu")
masked.learn(256)
recurrent = RecurrentPPO("MlpLstmPolicy", vector, n_steps=32, n_epochs=1, device="cpu")
recurrent.learn(128)
print(f"MaskablePPO, {masked.num_timesteps} decisions; RecurrentPPO, {recurrent.num_timesteps}")
