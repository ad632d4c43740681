"""Train a kart for a minute to lap a course alone: ``python examples/train_sb3.py``."""

import time

import torch
from stable_baselines3 import PPO
from stable_baselines3.common.vec_env import VecNormalize

from race_server.envs import KartVecEnv, time_trial_task

PARTS, REWARD = ("lidar", "speed", "steering"), {"progress": 1.0, "crash": -1.0}
SETTINGS = {"n_steps": 64, "batch_size": 1024, "n_epochs": 5, "learning_rate": 5e-4, "seed": 1}


def new_model() -> PPO:
    """Return an untrained policy with its karts, each alone on the course."""
    torch.set_num_threads(1)  # a network this small gains nothing from more
    task = time_trial_task("covapsy-train-2023", observation=PARTS, reward=REWARD)
    karts = VecNormalize(KartVecEnv(task, worlds=64, seed=1))
    model = PPO("MlpPolicy", karts, policy_kwargs={"log_std_init": -1.0}, device="cpu", **SETTINGS)
    # Brakes are stronger than the motor: to try things out around zero would be to stand.
    model.policy.action_net.bias.data[0] = 0.3
    return model


def mean_return(model: PPO) -> float:
    """Return how far [m] the last hundred karts came before they crashed or a minute was over."""
    returns = [episode["r"] for episode in model.ep_info_buffer]
    return sum(returns) / len(returns)


if __name__ == "__main__":
    model, end = new_model(), time.monotonic() + 60.0
    while time.monotonic() < end:
        model.learn(32_768, reset_num_timesteps=False)
        laps = [row["best_lap_s"] for row in model.ep_info_buffer if row["laps"]] or [0.0]
        print(f"{model.num_timesteps} decisions: {mean_return(model):.1f} m, lap {min(laps):.2f} s")
    model.save("kart.zip")
