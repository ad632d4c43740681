"""How fast PPO learns on races: ours beside Stable-Baselines3's, in one run on the same worlds."""

import statistics
import time
from collections.abc import Sequence
from typing import Any

import torch
from stable_baselines3 import PPO

from race_agents.training.fast_ppo import FastPpo
from race_agents.training.half_stack import has_units
from race_server.envs.presets import race_task
from race_server.envs.sb3 import KartVecEnv

WORLDS, KARTS = 64, 8
OPTIONS: dict[str, Any] = {"n_steps": 32, "batch_size": 4096, "n_epochs": 4}
ROUNDS = 3  # of each learner, in turn


def bench_ppo(
    *, threads: int = 2, rollouts: int = 8, layers: Sequence[int] = (64, 64)
) -> dict[str, Any]:
    """Return decisions per second of wall time, and µs of CPU time per decision.

    Learners: SB3's PPO on one thread and on worlds of `threads`, ours on one thread and on
    `threads`, and on one with inner products of bfloat16, where the processor has units for it and
    there are several layers. They take turns, so that what else runs on the machine is the same for
    all; each figure is the median of its rounds. layers: of actor and of critic.
    """
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    has_halves = has_units() and len(layers) > 1
    learners = {
        "sb3": _learner(PPO, 1, layers),
        "sb3_threads": _learner(PPO, threads, layers),
        "ours": _learner(FastPpo, 1, layers, threads=1),
        "ours_threads": _learner(FastPpo, threads, layers, threads=threads),
        **({"ours_halves": _learner(FastPpo, 1, layers, halves=True)} if has_halves else {}),
    }
    walls: dict[str, list[float]] = {name: [] for name in learners}
    spent: dict[str, list[float]] = {name: [] for name in learners}
    decisions = rollouts * OPTIONS["n_steps"] * WORLDS * KARTS
    try:
        for _ in range(ROUNDS):
            for name, learner in learners.items():
                wall, cpu = time.perf_counter(), time.process_time()
                learner.learn(decisions, reset_num_timesteps=False)
                walls[name].append(decisions / (time.perf_counter() - wall))
                spent[name].append(1e6 * (time.process_time() - cpu) / decisions)
    finally:
        for learner in learners.values():
            learner.env.close()
        torch.set_num_threads(before)
    rates = {name: statistics.median(numbers) for name, numbers in walls.items()}
    halves: dict[str, Any] = {}
    if has_halves:
        halves["halves_over_ours"] = round(rates["ours_halves"] / rates["ours"], 2)
    return {
        "decisions_per_s": {name: round(rate) for name, rate in rates.items()},
        "cpu_us": {name: round(statistics.median(each), 2) for name, each in spent.items()},
        "ours_over_sb3": round(rates["ours"] / rates["sb3"], 2),
        "ours_threads_over_sb3_threads": round(rates["ours_threads"] / rates["sb3_threads"], 2),
        "ours_threads_over_sb3": round(rates["ours_threads"] / rates["sb3"], 2),
        **halves,
        "threads": threads,
        "layers": list(layers),
        "worlds": WORLDS,
        "karts": KARTS,
        **OPTIONS,
    }


def _learner(kind: type[PPO], worlds: int, layers: Sequence[int], **own: Any) -> Any:
    """Return a learner, compiled and warm after one rollout. worlds: their threads."""
    task = race_task(karts=KARTS, observation="radar", random_start=True)
    env = KartVecEnv(task, worlds=WORLDS, threads=worlds)
    network = {"net_arch": list(layers)}
    learner = kind("MlpPolicy", env, policy_kwargs=network, device="cpu", seed=0, **OPTIONS, **own)
    return learner.learn(OPTIONS["n_steps"] * env.num_envs)
