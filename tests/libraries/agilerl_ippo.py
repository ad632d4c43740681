# /// script
# dependencies = ["agilerl==2.58.0", "peft==0.19.1"]
# ///
"""AgileRL: IPPO on races in its asynchronous vector of PettingZoo environments."""

import numpy as np
from agilerl.algorithms import IPPO
from agilerl.vector import AsyncPettingZooVecEnv

from race_server.envs import parallel_env


def make():
    return parallel_env(track="oval", karts=3, max_cycles=100)


if __name__ == "__main__":
    vector = AsyncPettingZooVecEnv([make, make])
    agents = vector.agents
    learner = IPPO(
        observation_spaces=[vector.single_observation_space(agent) for agent in agents],
        action_spaces=[vector.single_action_space(agent) for agent in agents],
        agent_ids=agents,
        batch_size=64,
        learn_step=64,
        net_config={"encoder_config": {"hidden_size": [32]}, "head_config": {"hidden_size": [32]}},
        device="cpu",
    )
    seen, infos = vector.reset()
    for _ in range(40):
        actions, *_ = learner.get_action(obs=seen, infos=infos)
        seen, rewards, *_, infos = vector.step(actions)
    assert all(np.isfinite(rewards[agent]).all() for agent in agents)
    vector.close()
    print("IPPO drives 40 decisions of 2 races of 3 karts, in two processes")
