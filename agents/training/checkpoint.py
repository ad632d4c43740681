"""Checkpoints: weights, optimisers, normalisation and counters as plain tensors.

They are read with PyTorch's restricted reader: nothing is unpickled that could run.
"""

from pathlib import Path
from typing import Any

import numpy as np
import torch

from agents.training.normaliser import Normaliser
from agents.training.pace import Pace
from race_server.errors import ScenarioError

COUNTERS = ("num_timesteps", "_n_updates", "_episode_num")


def save_checkpoint(
    path: Path, learner: Any, world: Normaliser, pace: Pace, score: float = 0.0
) -> None:
    """Write where a training stands, and what score the policy had if it was the best."""
    seen: Any = world.obs_rms  # one box, hence one set of means
    worth = world.ret_rms
    numbers = [
        (name, torch.as_tensor(value).clone())
        for name, value in (
            ("mean", seen.mean),
            ("variance", seen.var),
            ("count", seen.count),
            ("return_mean", worth.mean),
            ("return_variance", worth.var),
            ("return_count", worth.count),
            ("stretch", np.empty(0) if world.stretch is None else world.stretch),
        )
    ]
    content = {
        "parameters": learner.get_parameters(),
        "normalisation": dict(numbers),
        "counters": {name: int(getattr(learner, name)) for name in COUNTERS},
        "seconds": pace.seconds,
        "done": pace.done,
        "score": score,
    }
    # Written aside and moved: whoever is killed here leaves the checkpoint before whole.
    aside = path.with_suffix(".part")
    torch.save(content, aside)
    aside.replace(path)


def load_checkpoint(path: Path, learner: Any, world: Normaliser, pace: Pace) -> float:
    """Take a training up where a checkpoint left it; return the score that it was kept for.

    Raises:
        ScenarioError: the checkpoint is missing, damaged or of other settings.
    """
    try:
        content = torch.load(path, weights_only=True)
        learner.set_parameters(content["parameters"], exact_match=True, device="cpu")
        numbers = {name: value.numpy() for name, value in content["normalisation"].items()}
        seen: Any = world.obs_rms
        seen.mean, seen.var = numbers["mean"], numbers["variance"]
        seen.count = float(numbers["count"])
        worth = world.ret_rms
        worth.mean, worth.var = numbers["return_mean"], numbers["return_variance"]
        worth.count = float(numbers["return_count"])
        world.stretch = numbers["stretch"] if numbers["stretch"].size else None
        for name in COUNTERS:
            setattr(learner, name, content["counters"][name])
        pace.spent_s, pace.done = float(content["seconds"]), int(content["done"])
        return float(content["score"])
    except FileNotFoundError as error:
        raise ScenarioError(f"{path}: no such checkpoint; give the folder of a run") from error
    except Exception as error:  # PyTorch's reader raises whatever a damaged file leads it to
        raise ScenarioError(f"{path}: damaged, or of other settings: {error}") from error
