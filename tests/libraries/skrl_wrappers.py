# /// script
# dependencies = ["skrl==2.1.1"]
# ///
"""skrl: wrappers of a vector on one batch and of a race among agents."""

import gymnasium
import torch
from skrl.envs.wrappers.torch import wrap_env

from race_server.envs import parallel_env

made = gymnasium.make_vec("race_server:Kart/TimeTrial-v0", 8)
vector = wrap_env(made, wrapper="gymnasium")
seen, _ = vector.reset()
for _ in range(50):
    actions = torch.as_tensor(made.action_space.sample())
    seen, rewards, *_ = vector.step(actions)
assert seen.shape[0] == rewards.shape[0] == 8
race = wrap_env(parallel_env(track="oval", karts=3), wrapper="pettingzoo")
race.reset()
for _ in range(50):
    told = {agent: torch.zeros(1, 3) for agent in race.agents}
    seen, rewards, *_ = race.step(told)
assert set(seen) == {"kart_0", "kart_1", "kart_2"}
assert race.state()["kart_0"].shape[-1] == race.state_spaces["kart_0"].shape[0]
print("400 decisions of a vector of 8; 50 of a race of 3 agents, with its state")
