# /// script
# dependencies = ["ray[rllib]==2.60.0"]
# ///
"""RLlib's PPO on our vector beside `race train --ray`: the same task, network and lessons."""

import csv
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

# Ray gives way to all other programs.
os.environ["RAY_worker_niceness"] = "0"  # noqa: SIM112  # Ray writes it so
os.environ.setdefault("RAY_DEDUP_LOGS", "1")

import gymnasium
import ray
from ray.rllib.algorithms.ppo import PPOConfig
from ray.rllib.core.rl_module.default_model_config import DefaultModelConfig
from ray.tune.registry import register_env

WORLDS, DECISIONS, BATCH, EPOCHS, LAYERS = 64, 64, 1024, 5, [64, 64]
ROLLOUTS, OURS = 10, 400_000  # that are measured: RLlib's rollouts, our decisions
COUNTED = "num_env_steps_sampled_lifetime"
NAME = "race_server.envs:Kart/TimeTrial-v0"
TASK = {"track": "oval", "observation": ("lidar", "lidar_before", "speed", "steering")}


def made(config: dict) -> object:
    """Return one kart on its track, or as many as a vector has."""
    many = config.get("num_envs")
    return gymnasium.make_vec(NAME, num_envs=many, **TASK) if many else gymnasium.make(NAME, **TASK)


def rllib_rate(ways: str) -> float:
    """Return decisions a second with one runner beside the learner. ways: of vectorising."""
    ray.init(num_cpus=2, include_dashboard=False, logging_level="ERROR")
    register_env("kart", made)
    config = (
        PPOConfig()
        .environment("kart")
        .env_runners(
            num_env_runners=1,
            num_envs_per_env_runner=WORLDS,
            rollout_fragment_length=DECISIONS,
            gym_env_vectorize_mode=ways,
        )
        .training(
            train_batch_size_per_learner=WORLDS * DECISIONS,
            minibatch_size=BATCH,
            num_epochs=EPOCHS,
            gamma=0.99,
            lr=5e-4,
        )
        .rl_module(model_config=DefaultModelConfig(fcnet_hiddens=LAYERS, vf_share_layers=False))
        .learners(num_learners=0)
    )
    algorithm = config.build_algo()
    try:
        before = algorithm.train()  # the first one compiles
        begun = time.perf_counter()
        for _ in range(ROLLOUTS):
            after = algorithm.train()
        spent = time.perf_counter() - begun
        return (after[COUNTED] - before[COUNTED]) / spent
    finally:
        algorithm.stop()
        ray.shutdown()


def our_rate(folder: Path) -> float:
    """Return decisions a second of `race train --ray` with one runner beside the learner."""
    options = f"{{n_steps = {DECISIONS}, batch_size = {BATCH}, n_epochs = {EPOCHS}, gamma = 0.99}}"
    changes = (
        *(f"worlds={WORLDS}", f"algorithm.options={options}", f"network.layers={LAYERS}"),
        *("warm_start.teacher=", "tracks={names = ['oval']}", "lidar.rays=201"),
        *("evaluation.tracks={names = ['oval']}", "evaluation.final={names = ['oval']}"),
        *("evaluation.seeds=2", "evaluation.seconds=3.0", "evaluation.times=1"),
    )
    program = [sys.executable, "-m", "race_server", "train", "time-trial-ppo", "--ray", "local"]
    program += ["--runners", "1", "--steps", str(OURS), "--out", str(folder / "run")]
    for change in changes:
        program += ["--set", change]
    subprocess.run(program, check=True, capture_output=True)
    with (folder / "run" / "curve.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))[1:]  # the first rollout compiles
    spent = 60.0 * (float(rows[-1]["minutes"]) - float(rows[0]["minutes"]))
    return (int(rows[-1]["steps"]) - int(rows[0]["steps"])) / spent


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        ours = our_rate(Path(folder))
    one_by_one, batched = rllib_rate("sync"), rllib_rate("vector_entry_point")
    print(
        f"decisions/s with one runner: ours {ours:,.0f}; RLlib {batched:,.0f} on our vector, "
        f"{one_by_one:,.0f} on {WORLDS} single environments"
    )
