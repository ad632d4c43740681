"""Let a kart learn to lap a course alone: ``python examples/train_sb3.py --seconds 60``."""

import argparse
import time

import numpy as np
import torch
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize

from race_server.env.presets import time_trial_task
from race_server.env.sb3 import KartVecEnv

TASK = time_trial_task(
    "covapsy-train-2023",
    observation=("lidar", "speed", "steering"),
    reward={"progress": 1.0, "crash": -1.0},
)
WORLDS = 64
torch.set_num_threads(1)  # a network this small gains nothing from more


class Until(BaseCallback):
    """Ends the training after so many seconds, and keeps the return of every episode."""

    def __init__(self, seconds: float) -> None:
        super().__init__()
        self.seconds = seconds
        self.returns: list[float] = []

    def _on_training_start(self) -> None:
        self.end = time.monotonic() + self.seconds

    def _on_step(self) -> bool:
        over = [info["episode"]["r"] for info in self.locals["infos"] if "episode" in info]
        self.returns += over
        return time.monotonic() < self.end


def new_model(seed: int) -> PPO:
    """Return an untrained policy and the karts it learns with, each alone on the course."""
    karts = VecNormalize(KartVecEnv(TASK, worlds=WORLDS, seed=seed))
    model = PPO(
        "MlpPolicy",
        karts,
        n_steps=64,
        batch_size=1024,
        n_epochs=5,
        learning_rate=5e-4,
        policy_kwargs={"log_std_init": -1.0},
        seed=seed,
        device="cpu",
    )
    # Brakes are stronger than the motor: to try things out around zero would be to stand.
    model.policy.action_net.bias.data[0] = 0.3
    return model


def train(model: PPO, seconds: float) -> list[float]:
    """Train for a time and return the return of every episode, in the order of their ends."""
    callback = Until(seconds)
    model.learn(2**40, callback=callback)
    return callback.returns


def evaluate(model: PPO, worlds: int = 16) -> str:
    """Tell mean return and best lap of one episode in each world, without exploring."""
    karts = KartVecEnv(TASK, worlds=worlds, seed=1000)
    seen, episodes = karts.reset(), {}
    while len(episodes) < worlds:
        normal = model.get_vec_normalize_env().normalize_obs(seen)
        seen, _, dones, infos = karts.step(model.predict(normal, deterministic=True)[0])
        for number in np.flatnonzero(dones):
            episodes.setdefault(number, infos[number]["episode"])
    laps = [episode["best_lap_s"] for episode in episodes.values() if episode["laps"]]
    mean = np.mean([episode["r"] for episode in episodes.values()])
    return f"return {mean:.1f}, " + (f"best lap {min(laps):.2f} s" if laps else "no lap")


def main() -> None:
    """Train, and print what the policy is worth before and after."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    model = new_model(chosen.seed)
    print("before:", evaluate(model))
    returns = train(model, chosen.seconds)
    print(f"trained on {model.num_timesteps} decisions, {len(returns)} episodes")
    print("after:", evaluate(model))


if __name__ == "__main__":
    main()
