"""How much of a learner's time goes to the world: PPO on it, and on a world that costs nothing."""

import statistics
import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from race_server.envs.presets import race_task
from race_server.errors import brought_by

if TYPE_CHECKING:
    from stable_baselines3 import PPO
    from stable_baselines3.common.vec_env import VecEnv

WORLDS, KARTS = 64, 8
DECISIONS, BATCH_SIZE, EPOCHS, NETWORK = 32, 4096, 4, (64, 64)
ROLLOUTS = 8  # of each figure
ROUNDS = 3  # in turns: ours, ceiling, ours, ceiling and so on


def bench_learn(*, rollouts: int = ROLLOUTS) -> dict[str, Any]:
    """Return the figures of `race bench learn`: time steps of `learn` per second of CPU time.

    The shares are of the time of ours: `world_share` in `step_wait`, `gradients_share` in `train`,
    and `rollouts_share` for all between, answers of the network and the buffer.

    Raises:
        ScenarioError: Stable-Baselines3 or PyTorch is not installed.
    """
    with brought_by("train"):
        import torch

        from race_server.envs.sb3 import KartVecEnv
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    ours = KartVecEnv(race_task(karts=KARTS, observation="radar", random_start=True), worlds=WORLDS)
    try:
        learners = {"ours": _learner(ours), "ceiling": _learner(_free_of_cost(ours))}
        fps: dict[str, list[float]] = {name: [] for name in learners}
        for _ in range(ROUNDS):
            for name, learner in learners.items():
                fps[name].append(_learn(learner, rollouts))
        shares = _shares(learners["ours"], ours, rollouts)
    finally:
        ours.close()
        torch.set_num_threads(threads)
    medians = {name: statistics.median(numbers) for name, numbers in fps.items()}
    return {
        "ceiling_fps": round(medians["ceiling"]),
        "ours_fps": round(medians["ours"]),
        "ratio": round(medians["ours"] / medians["ceiling"], 3),
        **{f"{name}_share": round(share, 3) for name, share in shares.items()},
        "batch_size": BATCH_SIZE,
        "n_steps": DECISIONS,
        "n_epochs": EPOCHS,
        "worlds": WORLDS,
        "karts": KARTS,
    }


def _learner(env: "VecEnv") -> "PPO":
    """Return PPO on `env`, compiled and warm after one rollout."""
    from stable_baselines3 import PPO

    learner = PPO(
        "MlpPolicy",
        env,
        n_steps=DECISIONS,
        batch_size=BATCH_SIZE,
        n_epochs=EPOCHS,
        policy_kwargs={"net_arch": list(NETWORK)},
        device="cpu",
        seed=0,
    )
    return learner.learn(DECISIONS * env.num_envs)


def _learn(learner: "PPO", rollouts: int) -> float:
    """Return time steps per CPU second of `rollouts` rollouts, each with its gradient steps."""
    steps = rollouts * DECISIONS * WORLDS * KARTS
    begun = time.process_time()
    learner.learn(steps, reset_num_timesteps=False)
    return steps / (time.process_time() - begun)


def _shares(learner: Any, env: Any, rollouts: int) -> dict[str, float]:
    """Return where the CPU time of a learner goes."""
    spent = {"world": 0.0, "gradients": 0.0}

    def timed(name: str, work: Callable[[], Any]) -> Callable[[], Any]:
        def do() -> Any:
            begun = time.process_time()
            done = work()
            spent[name] += time.process_time() - begun
            return done

        return do

    env.step_wait, learner.train = timed("world", env.step_wait), timed("gradients", learner.train)
    whole = rollouts * DECISIONS * WORLDS * KARTS / _learn(learner, rollouts)
    shares = {name: seconds / whole for name, seconds in spent.items()}
    return {**shares, "rollouts": 1.0 - sum(shares.values())}


def _free_of_cost(like: "VecEnv") -> "VecEnv":
    """Return an environment of the same shapes that always hands out the same arrays."""
    from race_server.envs.sb3 import KartVecEnv

    class Nothing(KartVecEnv):
        """Nothing happens, and no episode ends."""

        def __init__(self) -> None:
            super(KartVecEnv, self).__init__(
                like.num_envs, like.observation_space, like.action_space
            )
            self.seen = like.reset()
            self.rewards = np.zeros(like.num_envs, np.float32)
            self.dones = np.zeros(like.num_envs, np.bool_)
            self.infos: list[dict[str, Any]] = [{} for _ in range(like.num_envs)]

        def reset(self) -> Any:
            return self.seen

        def step_wait(self) -> tuple[Any, Any, Any, list[dict[str, Any]]]:
            return self.seen, self.rewards, self.dones, self.infos

        def close(self) -> None:
            pass

    return Nothing()
