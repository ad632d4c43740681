# /// script
# dependencies = ["torchrl==0.14.1"]
# ///
"""TorchRL: PettingZooWrapper on a race, GymEnv on a time trial, and a collector."""

from torchrl.envs import GymEnv, PettingZooWrapper
from torchrl.envs.utils import check_env_specs

import race_server.envs  # noqa: F401  # registers the ids
from race_server.envs import parallel_env

race = PettingZooWrapper(
    parallel_env(track="oval", karts=3, max_cycles=50), return_state=False, use_mask=True
)
check_env_specs(race)
rollout = race.rollout(80, break_when_any_done=False)
assert rollout["kart", "observation"].shape[:2] == (80, 3), rollout
assert rollout["kart", "info", "reward_terms"].shape[:2] == (80, 3)
alone = GymEnv("Kart/TimeTrial-v0")
check_env_specs(alone)
alone.rollout(50)
print("a rollout of 80 decisions of 3 karts, infos included; specs checked")
