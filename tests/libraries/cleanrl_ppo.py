# /// script
# dependencies = ["gymnasium==1.4.0"]
# ///
"""CleanRL's way: the loop of its `ppo_continuous_action.py` in one file, with Gymnasium's wrappers.

CleanRL is no package to install but a page to copy from, so this is its loop, shortened.
"""

import gymnasium as gym
import numpy as np
import torch
from torch import nn
from torch.distributions import Normal

ENVS, STEPS, UPDATES = 4, 64, 4


def make_env():
    def thunk():
        env = gym.make("race_server:Kart/TimeTrial-v0", most_steps=50)
        env = gym.wrappers.FlattenObservation(env)
        env = gym.wrappers.RecordEpisodeStatistics(env)
        env = gym.wrappers.ClipAction(env)
        env = gym.wrappers.NormalizeObservation(env)
        space = env.observation_space
        env = gym.wrappers.TransformObservation(env, lambda obs: np.clip(obs, -10, 10), space)
        env = gym.wrappers.NormalizeReward(env, gamma=0.99)
        return gym.wrappers.TransformReward(env, lambda reward: np.clip(reward, -10, 10))

    return thunk


def layers(size, answers):
    return nn.Sequential(nn.Linear(size, 64), nn.Tanh(), nn.Linear(64, answers))


envs = gym.vector.SyncVectorEnv(
    [make_env() for _ in range(ENVS)], autoreset_mode=gym.vector.AutoresetMode.SAME_STEP
)
size, width = envs.single_observation_space.shape[0], envs.single_action_space.shape[0]
critic, actor = layers(size, 1), layers(size, width)
log_std = nn.Parameter(torch.zeros(width))
optimizer = torch.optim.Adam([*critic.parameters(), *actor.parameters(), log_std], lr=3e-4)
next_obs = torch.as_tensor(envs.reset(seed=1)[0], dtype=torch.float32)
episodes = 0
for _ in range(UPDATES):
    obs, acts, logs, rewards, values, nexts = [], [], [], [], [], []
    for _ in range(STEPS):
        with torch.no_grad():
            normal = Normal(actor(next_obs), log_std.exp())
            action = normal.sample()
            logs.append(normal.log_prob(action).sum(1))
            values.append(critic(next_obs).flatten())
        obs.append(next_obs)
        acts.append(action)
        seen, reward, ended, cut, infos = envs.step(action.numpy())
        if "final_info" in infos:
            episodes += int(infos["final_info"]["_episode"].sum())
        rewards.append(torch.as_tensor(reward, dtype=torch.float32))
        nexts.append(1.0 - torch.as_tensor(ended | cut, dtype=torch.float32))
        next_obs = torch.as_tensor(seen, dtype=torch.float32)
    with torch.no_grad():
        returns, after = [], critic(next_obs).flatten()
        for reward, goes_on in zip(reversed(rewards), reversed(nexts), strict=True):
            after = reward + 0.99 * goes_on * after
            returns.insert(0, after)
    flat = [torch.cat(rows) for rows in (obs, acts, logs, values, returns)]
    for _ in range(2):
        normal = Normal(actor(flat[0]), log_std.exp())
        ratio = (normal.log_prob(flat[1]).sum(1) - flat[2]).exp()
        gain = flat[4] - flat[3]
        gain = (gain - gain.mean()) / (gain.std() + 1e-8)
        clipped = torch.max(-gain * ratio, -gain * ratio.clamp(0.8, 1.2)).mean()
        loss = clipped + 0.5 * (critic(flat[0]).flatten() - flat[4]).pow(2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()
assert np.isfinite(loss.item())
assert episodes > 0
envs.close()
print(f"PPO, {ENVS * STEPS * UPDATES} decisions, {episodes} episodes")
