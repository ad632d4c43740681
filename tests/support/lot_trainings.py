"""Small trainings in a lot, and demonstrations for them."""

from pathlib import Path

import numpy as np

from race_agents.training.demonstrations import (
    About,
    Demonstrations,
    write_demonstrations,
)
from race_agents.training.settings import Settings
from race_agents.training.settings_toml import read_settings
from race_server.core.observation import PRESETS, layout_of
from race_server.scenario.sensors import Lidar

# The simple scenario: one slot, 5 m ahead.
SIMPLE = (
    "parking.lots=['face-to-face']",
    "worlds=4",
    "network={layers = [8]}",
    "algorithm.options={n_steps = 32, batch_size = 64, n_epochs = 1}",
    "evaluation={score = 'success', seeds = 3, times = 1}",
)
QUICK = (*SIMPLE, "parking.limit_s=3.0", "steps=256")
NEAR, FAR = (
    "{after = 0.0, distance = [2.0, 5.0], until_success = 0.5, episodes = 2}",
    "{after = 0.9}",
)


def settings(*changes: str) -> Settings:
    return read_settings("parking-1", [*QUICK, *changes])


def write_shown(path: Path, steering: float, decision_s: float = 0.1) -> Path:
    """Write demonstrations of a driver that always drives and steers the same."""
    parts = PRESETS["lot"]
    size = layout_of(parts, Lidar().rays).size
    seen = np.random.default_rng(1).normal(0.0, 1.0, (200, size)).astype(np.float32)
    controls = np.tile(np.float32([steering, 0.5, 0.0, 0.0]), (200, 1))
    lidar = Lidar()
    about = About(
        driver="planner",
        tracks=("face-to-face",),
        vehicle="kart-13",
        parts=parts,
        lidar_rays=lidar.rays,
        lidar_field=lidar.field,
        lidar_reach=lidar.reach,
        decision_s=decision_s,
    )
    write_demonstrations(path, Demonstrations(about, seen, controls))
    return path
