# /// script
# dependencies = ["pufferlib-core==3.0.23"]
# ///
"""PufferLib: its emulation of Gymnasium and PettingZoo, in its vectors, also in processes."""

from functools import partial

import gymnasium
import numpy as np
import pufferlib.emulation
import pufferlib.vector

from race_server.envs import parallel_env


def alone(buf=None, seed=0):
    env = gymnasium.make("race_server:Kart/TimeTrial-v0")
    return pufferlib.emulation.GymnasiumPufferEnv(env=env, buf=buf, seed=seed)


def race(buf=None, seed=0):
    env = parallel_env(track="oval", karts=4, max_cycles=30)
    return pufferlib.emulation.PettingZooPufferEnv(env=env, buf=buf, seed=seed)


def drive(vector, steps=50):
    vector.reset(seed=1)
    for _ in range(steps):
        seen, rewards, *_ = vector.step(vector.action_space.sample())
    assert np.isfinite(seen).all()
    assert np.isfinite(rewards).all()
    vector.close()
    return steps * len(rewards)


if __name__ == "__main__":
    serial = partial(pufferlib.vector.make, backend=pufferlib.vector.Serial, num_envs=2)
    total = drive(serial(alone)) + drive(serial(race))
    several = {"backend": pufferlib.vector.Multiprocessing, "num_envs": 2, "num_workers": 2}
    total += drive(pufferlib.vector.make(race, **several))
    print(f"{total} decisions: alone and 4 karts, in one process and in two")
