# /// script
# dependencies = ["d3rlpy==2.8.1"]
# ///
"""d3rlpy: a data set of Gymnasium's environment, TD3 with behaviour cloning on it, offline."""

import d3rlpy
import gymnasium

env = gymnasium.make("race_server:Kart/TimeTrial-v0", most_steps=100)
buffer = d3rlpy.dataset.create_fifo_replay_buffer(limit=2000, env=env)
explorer = d3rlpy.algos.DDPGConfig(batch_size=32).create(device="cpu:0")
explorer.build_with_env(env)
explorer.collect(env, buffer, n_steps=500, show_progress=False)
learner = d3rlpy.algos.TD3PlusBCConfig(batch_size=32).create(device="cpu:0")
learner.fit(buffer, n_steps=100, n_steps_per_epoch=100, show_progress=False, save_interval=10)
score = d3rlpy.metrics.EnvironmentEvaluator(env, n_trials=1)(learner, None)
print(f"500 decisions collected, 100 lessons of TD3+BC, a return of {score:.0f}")
