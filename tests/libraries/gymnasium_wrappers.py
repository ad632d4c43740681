# /// script
# dependencies = ["gymnasium==1.4.0", "moviepy==2.2.1"]
# ///
"""Gymnasium's wrappers: statistics, normalisation, videos; vectors in all modes and processes."""

import tempfile
from pathlib import Path

import gymnasium
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import RecordVideo
from gymnasium.wrappers import vector as wrappers

if __name__ == "__main__":
    for mode in AutoresetMode:
        vector = gymnasium.make_vec(
            "race_server:Kart/TimeTrial-v0", 3, autoreset_mode=mode, most_steps=20
        )
        vector = counted = wrappers.RecordEpisodeStatistics(vector)
        vector = wrappers.RescaleAction(vector, -1.0, 1.0)
        if mode is AutoresetMode.NEXT_STEP:
            vector = wrappers.NormalizeObservation(vector)
        vector = wrappers.NormalizeReward(vector)
        vector.reset(seed=1)
        for _ in range(60):
            *_, ended, cut, infos = vector.step(vector.action_space.sample())
            if mode is AutoresetMode.DISABLED and (ended | cut).any():
                vector.reset(options={"reset_mask": ended | cut})
        assert counted.episode_count > 0
        vector.close()
    with tempfile.TemporaryDirectory() as folder:
        vector = gymnasium.make_vec(
            "race_server:Kart/TimeTrial-v0", 2, render_mode="rgb_array", autoreset_mode="NextStep"
        )
        vector = wrappers.RecordVideo(vector, folder, video_length=10)
        vector.reset(seed=1)
        for _ in range(12):
            vector.step(vector.action_space.sample())
        vector.close()
        one = RecordVideo(
            gymnasium.make("race_server:Kart/TimeTrial-v0", render_mode="rgb_array"),
            folder,
            name_prefix="one",
            video_length=10,
        )
        one.reset(seed=1)
        for _ in range(12):
            one.step(one.action_space.sample())
        one.close()
        films = sorted(path.name for path in Path(folder).glob("*.mp4"))
    assert len(films) == 2, films
    many = gymnasium.make_vec("race_server:Kart/TimeTrial-v0", 2, vectorization_mode="async")
    many.reset(seed=[3, 4])
    many.step(many.action_space.sample())
    many.close()
    print("three autoreset modes, five wrappers, two videos, environments in processes")
